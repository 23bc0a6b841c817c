#include "hal/linux/gpio/output_line.h"

#include <cerrno>
#include <ctime>

namespace nodal::hal::gpio {

OutputLine::~OutputLine() { (void)line_->set(safe_level_); }

int OutputLine::write(bool high) {
  // write() sets writing_ before it reads safe_, make_safe() sets safe_ before it reads writing_: one of them sees the
  // other, so the safe level is written last.
  writing_.store(true);
  if (safe_.load()) {
    writing_.store(false);
    return ECANCELED;
  }
  const int error = line_->set(high);
  writing_.store(false);
  if (!safe_.load()) return error;
  (void)line_->set(safe_level_);
  return ECANCELED;
}

void OutputLine::make_safe() noexcept {
  safe_.store(true);
  // Counted sleeps, because a clock may stand still while a guest's processor is busy.
  constexpr int kTries = 40;
  constexpr timespec kPause{0, 50'000};
  for (int i = 0; i < kTries && writing_.load(); ++i) ::nanosleep(&kPause, nullptr);
  if (!writing_.load()) (void)line_->set(safe_level_);
}

Result<std::unique_ptr<OutputLine>> claim_output(System& system, const LineName& name, bool safe_level) {
  Claim claim = system.claim_output(name, safe_level);
  if (!claim.line) return fail(explain_claim(system, name, claim.error));
  return std::make_unique<OutputLine>(name, std::move(claim.line), safe_level);
}

}  // namespace nodal::hal::gpio
