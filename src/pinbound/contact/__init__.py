"""What contact is: one rule, for `load`, limits, certificates, regions, batches and cross-checks alike.

A boundary is a *stop*, a *height* or a *distance*; `rule` says which, and gives its signed clearance. `batch` asks many
boundaries at once. `docs/contacts.md` gives the arguments.
"""

from pinbound.contact.batch import SignedKernel
from pinbound.contact.rule import ContactRule, Stop, contact_distance, signed_share, stop_fault

__all__ = ["ContactRule", "SignedKernel", "Stop", "contact_distance", "signed_share", "stop_fault"]
