from . import dimension as dimension
from . import expression as expression
