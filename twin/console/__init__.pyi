from .joysticks import Desk as Desk
from .joysticks import control as control
from .page import register as register
from .session import Host as Host
from .session import Panel as Panel
