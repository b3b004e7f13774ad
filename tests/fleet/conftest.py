import pytest
from fleet_rig import Box, HubRig
from mqtt_broker import Mosquitto

from dnb_edge.fleet import listener


@pytest.fixture(autouse=True)
def soon_ended(monkeypatch):
    """Listeners look often whether they are to end: many do here."""
    monkeypatch.setattr(listener, "LISTEN_S", 0.05)


@pytest.fixture
def broker(tmp_path):
    """Without persistence: what it has not passed on is lost when it is killed."""
    with Mosquitto(tmp_path) as one:
        yield one


@pytest.fixture
def make_box(tmp_path):
    made = []

    def make(*arguments, **options):
        made.append(Box(tmp_path, *arguments, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def make_hub(tmp_path):
    made = []

    def make(*arguments):
        made.append(HubRig(tmp_path, *arguments))
        return made[-1]

    yield make
    for one in made:
        one.stop()
