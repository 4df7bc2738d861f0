"""What a study says: distributions, how often expectations hold, what fails together, what drives a metric; and its page."""

from twin.study.answers.page import PAGE, write_report
from twin.study.answers.sentences import headline
from twin.study.answers.summary import Answers, noteworthy, percent
from twin.study.answers.tables import open_command

__all__ = ["PAGE", "Answers", "headline", "noteworthy", "open_command", "percent", "write_report"]
