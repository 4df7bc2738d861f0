from . import csv_source as csv_source
