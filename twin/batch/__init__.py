"""Many recordings through the verbs, each a unit of its own: whatever fails, the others go on."""

from twin.batch.batch import Batch as Batch
from twin.batch.batch import Settings as Settings
from twin.batch.units import Unit as Unit
from twin.batch.units import units_of as units_of
