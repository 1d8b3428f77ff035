"""What a twin and each of its parts is worth: `trusted`, `doubtful` or `refused`, with the reasons.

Who wants to know what is doubted asks for the `type` of a reason; who counts causes counts `kind`, which
leaves the numbers out. docs/verdicts.md lists them all.
"""

from twin.verdict.document import verdict_document as verdict_document
from twin.verdict.document import verdict_from as verdict_from
from twin.verdict.reason import LEVELS as LEVELS
from twin.verdict.reason import Level as Level
from twin.verdict.reason import Reason as Reason
from twin.verdict.reason import worst as worst
from twin.verdict.reasons import REASONS as REASONS
from twin.verdict.reasons import reason as reason
from twin.verdict.text import unjudged as unjudged
from twin.verdict.text import verdict_line as verdict_line
from twin.verdict.verdict import Verdict as Verdict
from twin.verdict.verdict import of_twin as of_twin
