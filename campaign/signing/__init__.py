"""Signatures of short texts by OpenSSH: `ssh-keygen -Y`, in the namespace `campaign-run@1`.

A signature proves who made it, with which key and for which purpose. It does not prove when.
"""

from campaign.signing.signature_check import AllowedSigners, SignatureError, verify
from campaign.signing.signature_file import Signature, check_key, sign, sign_test_text
from campaign.signing.tool import check_tool

__all__ = [
    "AllowedSigners",
    "Signature",
    "SignatureError",
    "check_key",
    "check_tool",
    "sign",
    "sign_test_text",
    "verify",
]
