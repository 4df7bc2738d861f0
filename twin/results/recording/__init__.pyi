from . import rows as rows
from . import run_folder as run_folder
from . import signals as signals
from . import stream as stream
