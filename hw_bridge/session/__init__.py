"""One case of a scenario on drives."""

from hw_bridge.session import outputs as outputs
from hw_bridge.session import targets as targets
from hw_bridge.session.output_bindings import AGE as AGE
from hw_bridge.session.session import Observers as Observers
from hw_bridge.session.session import Session as Session
