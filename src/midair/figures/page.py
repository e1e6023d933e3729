"""HTML pages that stand alone: one look for all of them."""

from typing import Any


def render_page(template: str, **values: Any) -> str:
    """A page from a template that extends this folder's page.html.j2; every value that it names must be given.

    Parameters
    ----------
    template : str
        Its place below the package, such as ``rig/looping/report.html.j2``.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("midair", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template(template).render(values)
