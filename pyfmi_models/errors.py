"""What can go wrong with a model.

ModelError
├── CardError      a model card is missing, unreadable or breaks a rule
├── PluginError    a law or an effect from outside cannot be loaded
└── ExportError    the equations could not be turned into C, a binary or an archive
"""


class ModelError(Exception):
    """Base of every error this package raises on purpose; its text is one sentence for a person."""


class CardError(ModelError):
    """A model card is missing, unreadable, or a key or value in it breaks a rule."""


class PluginError(ModelError):
    """A folder, file or entry point with laws or effects cannot be loaded, or what it brings breaks a rule."""


class ExportError(ModelError):
    """The equations could not be turned into C, a shared library or an archive."""
