#include "host_tool/commands/trial.h"

#include "host_tool/console/interrupt.h"
#include "protocol/base/try.h"

namespace nodal::host {

Result<TrialVerdict> try_out(Context& context, const Calibration& tried, int sets, const UploadTerms& terms,
                             std::string document) {
  Console& console = context.console();
  const Reconnect connect = [&context] { return context.connect(); };
  NODAL_TRY_ASSIGN(const std::unique_ptr<RigTrial> trial,
                   RigTrial::begin(connect, tried, terms, std::move(document), console));
  // A signal during the computation ends the program; for the rig that is a lost link, and the rig reverts by itself.
  NODAL_TRY_ASSIGN(const RigPictures pictures, trial->pull(sets, console));
  NODAL_TRY_ASSIGN(const TrialFigures figures, interruptible(console, [&] { return trial->compare(pictures); }));
  const TrialVerdict verdict{figures, figures.better()};
  NODAL_TRY(trial->end(verdict.kept));
  return verdict;
}

void tell_verdict(Context& context, const TrialVerdict& verdict) {
  Console& console = context.console();
  console.document({{"trial",
                     {{"objective_before", verdict.figures.before},
                      {"objective_after", verdict.figures.after},
                      {"kept", verdict.kept}}}});
  if (!verdict.kept) {
    console.warning("the calibration that was tried is not better, and the rig uses the previous one again: " +
                    verdict.figures.text());
    context.answer = ExitCode::kJudged;
    return;
  }
  console.line("kept: " + verdict.figures.text());
}

}  // namespace nodal::host
