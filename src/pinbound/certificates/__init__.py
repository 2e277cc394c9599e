"""Certificates: motions and boxes proved clear, or a witness found; `docs/certificates.md` has the argument."""

from pinbound.certificates.boxes import certified_box, certify_box
from pinbound.certificates.constraints import signed_clearances
from pinbound.certificates.motions import certify
from pinbound.certificates.records import (
    BoxCertificate,
    Budget,
    Certificate,
    Contact,
    Finding,
    Findings,
    OpenBox,
    OpenPart,
    Reason,
    Verdict,
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
    "OpenPart",
    "Reason",
    "Verdict",
    "certified_box",
    "certify",
    "certify_box",
    "signed_clearances",
]
