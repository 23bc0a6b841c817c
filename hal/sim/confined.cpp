#include "hal/sim/confined.h"

namespace nodal::hal::sim {

Status SimConfined::begin(ConfinedJob job) {
  if (lost_) return fail(Errc::kDeviceGone, "the confined process is gone; restart nodald");
  if (job_) return fail(Errc::kBusy, "another job runs");
  job_ = std::move(job);
  asked_ = false;
  progress_ = 0;
  ++begun_;
  return {};
}

std::optional<Result<std::vector<std::uint8_t>>> SimConfined::take_result() {
  if (!job_) return std::nullopt;
  if (lost_) {
    job_.reset();
    return fail(Errc::kDeviceGone, "the confined process is gone; restart nodald");
  }
  if (!std::exchange(asked_, true) || holds_) return std::nullopt;
  const ConfinedJob job = *std::exchange(job_, std::nullopt);
  if (crashes_) return fail(Errc::kInternal, "the confined process crashed (signal 11)");
  return work_(job, [this] { ++progress_; });
}

}  // namespace nodal::hal::sim
