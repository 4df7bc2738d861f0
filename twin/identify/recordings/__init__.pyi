from . import replay as replay
