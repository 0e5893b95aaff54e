"""Command group ``forcefit validation``."""

from forcefit.commands.correction import carry, compensate, explain, predict
from forcefit.commands.crosscheck import crosscheck
from forcefit.commands.diagnose import diagnose
from forcefit.commands.exchange import import_
from forcefit.commands.generate import generate
from forcefit.commands.help import Commands
from forcefit.commands.inspect import inspect
from forcefit.commands.plan import plan
from forcefit.commands.validity import validity

app = Commands(no_args_is_help=True)
app.command()(diagnose)
app.command()(generate)
app.command()(inspect)
app.command()(plan)
app.command("import")(import_)
app.command()(carry)
app.command()(explain)
app.command()(predict)
app.command()(compensate)
app.command()(crosscheck)
app.command()(validity)


@app.callback()
def validation() -> None:
    """Validation by simulation and measured data."""
