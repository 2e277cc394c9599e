"""The contact rule: one rule for `load`, limits, certificates, regions, batches and cross-checks.

A boundary is a *stop*, a *height* or a *distance*; `rule` decides which, and computes its signed clearance. `batch`
does this for many boundaries at once. `docs/contacts.md` has the reasons.
"""

from pinbound.contact.batch import SignedKernel
from pinbound.contact.rule import ContactRule, Stop, contact_distance, signed_share, stop_fault

__all__ = ["ContactRule", "SignedKernel", "Stop", "contact_distance", "signed_share", "stop_fault"]
