from .page import embedded_page as embedded_page
from .runs import RunCollection as RunCollection
from .runs import ViewedCurve as ViewedCurve
from .runs import open_recorded_run as open_recorded_run
from .selection import left_out as left_out
from .selection import select_cases as select_cases
from .selection import select_signals as select_signals
from .server import serve as serve
