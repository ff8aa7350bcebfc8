"""What is no address of a scheduler is one sentence, before anybody is asked."""

import pytest

from cosim.support.errors import SweepError
from cosim.sweeps.cluster import ADDRESS, _client


@pytest.mark.parametrize("address", ["foo", "tcp://host", "tcp://", "host:", "a b:1", "127.0.0.1"])
def test_what_is_no_address_of_a_scheduler_is_refused_before_anybody_is_asked(address: str) -> None:
    with pytest.raises(SweepError, match="is no address of a Dask scheduler; write it as tcp://host:8786") as refused:
        _client(address)
    assert refused.value.culprit == address


@pytest.mark.parametrize(
    "address", ["tcp://host:8786", "tls://10.0.0.1:1", "host:8786", "tcp://[::1]:8786", "inproc://1/2/3"]
)
def test_addresses_are_known(address: str) -> None:
    assert ADDRESS.fullmatch(address)
