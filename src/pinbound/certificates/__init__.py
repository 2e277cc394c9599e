"""Certificates: motions and boxes proved clear, or a witness found; `docs/certificates.md` has the argument."""

from pinbound.certificates.box_records import BoxCertificate, OpenBoxes
from pinbound.certificates.boxes import certified_box, certify_box
from pinbound.certificates.constraints import signed_clearances
from pinbound.certificates.many import certify_many
from pinbound.certificates.motions import certify
from pinbound.certificates.records import (
    Budget,
    Certificate,
    Contact,
    Finding,
    Findings,
    OpenBox,
    OpenPart,
    Reason,
    Verdict,
    Verdicts,
)
from pinbound.certificates.trajectory import BoundedMotion

__all__ = [
    "BoundedMotion",
    "BoxCertificate",
    "Budget",
    "Certificate",
    "Contact",
    "Finding",
    "Findings",
    "OpenBox",
    "OpenBoxes",
    "OpenPart",
    "Reason",
    "Verdict",
    "Verdicts",
    "certified_box",
    "certify",
    "certify_box",
    "certify_many",
    "signed_clearances",
]
