"""What a study says: distributions, how often expectations hold, what fails together, what drives a metric; and its page."""

from twin.study.answers.page import PAGE as PAGE
from twin.study.answers.page import PlotSet as PlotSet
from twin.study.answers.page import write_report as write_report
from twin.study.answers.sentences import headline as headline
from twin.study.answers.sentences import unreached_windows as unreached_windows
from twin.study.answers.summary import Answers as Answers
from twin.study.answers.summary import noteworthy as noteworthy
from twin.study.answers.summary import percent as percent
from twin.study.answers.tables import open_command as open_command
