"""References to ports: "component.variable", "signal.output", or "signal" where it has only one output."""


class PortRef(str):
    """A port by name: the text of a scenario, with its two parts.

    `owner` is what stands before the first dot, `port` what stands behind it (a name of an FMU may hold dots itself),
    "" where there is no dot. It compares, sorts and prints as its text.
    """

    __slots__ = ()

    @property
    def owner(self) -> str:
        """The component or signal."""
        return self.partition(".")[0]

    @property
    def port(self) -> str:
        """The variable or output; "" where only the owner is named."""
        return self.partition(".")[2]

    @property
    def parts(self) -> tuple[str, str]:
        """Owner and port."""
        return self.owner, self.port


class PortField:
    """A field of a dataclass that is given as text and read as `PortRef`; it has no default."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object | None, owner: type | None = None) -> PortRef:
        if instance is None:
            raise AttributeError(self._name)
        value: PortRef = instance.__dict__[self._name]
        return value

    def __set__(self, instance: object, value: str) -> None:
        instance.__dict__[self._name] = PortRef(value)
