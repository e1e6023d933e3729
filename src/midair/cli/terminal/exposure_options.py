"""What may be exposed to what: options that every command has which can sound."""

from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from midair.devices import ExposureChoices
from midair.files import DEFAULT_PROFILE, profile_named


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureOptions:
    """What a drive may expose people to, on a device that can be heard.

    Parameters
    ----------
    profile
        Of exposure.
    profiles
        TOML file of exposure profiles; those that come with midair if not given.
    attenuate
        Weaken drives until they keep the profile.
    override_exposure
        Name of the person who answers for playing above the profile; it is logged.
    """

    profile: str = DEFAULT_PROFILE
    profiles: Path | None = None
    attenuate: bool = False
    override_exposure: str | None = None

    def choices(self) -> ExposureChoices:
        """As one value."""
        return ExposureChoices(
            profile=profile_named(self.profile, self.profiles),
            attenuate=self.attenuate,
            override=self.override_exposure,
        )
