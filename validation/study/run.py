"""Read a study file, run every check, and write the report."""

from dataclasses import replace
from pathlib import Path

from forcefit.inputs.packages import need
from forcefit.validation.study.report import write_study
from forcefit.validation.study.study import Progress, StudyResults
from forcefit.validation.study.study import run_study as run_checks
from forcefit.validation.study.study_file import Study, read_study


def run_study(
    study: Study | Path | str,
    progress: Progress = lambda *_: None,
    *,
    output: Path | str | None = None,
) -> StudyResults:
    """Run every check of a study and, if a folder is given, write the report.

    Args:
        study: path of a study file (TOML), or a study read from such a file.
        progress: function called with the name of a check, the number of finished steps
            and the number of all steps.
        output: folder for ``report.html``, ``results.json`` and ``results.nc``; None to
            write no files.

    Returns:
        The results.

    Raises:
        BadInput: the study file or its robot is invalid, the pose is unreachable, a
            surface cannot be meshed, or the folder cannot be written.
        ModuleNotFoundError: a package that a check requires is missing.
    """
    if not isinstance(study, Study):
        study = read_study(study, output)
    elif output is not None:
        study = replace(study, folder=Path(output))
    if output is None:
        return run_checks(study, progress)
    need("jinja2")
    results = run_checks(study, progress)
    progress("report", 0, 1)
    write_study(results)
    progress("report", 1, 1)
    return results
