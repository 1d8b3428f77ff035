"""What a user changes about a twin: edits that last, are told in every file, and can be taken back."""

from twin.edits.edit import SAID as SAID
from twin.edits.edit import Edit as Edit
from twin.edits.journal import Made as Made
from twin.edits.journal import add as add
from twin.edits.journal import edit_of as edit_of
from twin.edits.journal import found_folder as found_folder
from twin.edits.journal import found_twin as found_twin
from twin.edits.journal import keep as keep
from twin.edits.journal import kept_aside as kept_aside
from twin.edits.journal import made as made
from twin.edits.journal import read as read
from twin.edits.journal import said_before as said_before
from twin.edits.journal import settled as settled
from twin.edits.journal import undo as undo
from twin.edits.journal import with_said as with_said
from twin.edits.kinds import KINDS as KINDS
from twin.edits.unfit import Unfit as Unfit
