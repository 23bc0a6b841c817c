#include "firmware/calibration/rehearsal.h"

#include <fmt/format.h>

#include <charconv>
#include <sstream>
#include <string_view>
#include <utility>

#include "firmware/calibration/calibration_keeper.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

/// "0 640 480 - 3 ...": format, width and height of each head; "-" for one that was never open.
std::string text_of(const HeadShapes& heads) {
  std::string text;
  for (const auto& head : heads) {
    if (!text.empty()) text += ' ';
    if (!head) text += '-';
    else text += fmt::format("{} {} {}", static_cast<int>(head->format), head->width, head->height);
  }
  return text;
}

HeadShapes shapes_of(const std::string& text) {
  HeadShapes heads;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (word == "-") {
      heads.emplace_back();
      continue;
    }
    int format = 0;
    std::from_chars(word.data(), word.data() + word.size(), format);
    HeadShape head{static_cast<PixelFormat>(format), 0, 0};
    words >> head.width >> head.height;
    heads.emplace_back(head);
  }
  return heads;
}

}  // namespace

Result<sets::PlanJob> plan_within_budget(const Calibration& fitted, const RigConfig& config, const HeadShapes& heads) {
  NODAL_TRY_ASSIGN(
      auto job, sets::PlanJob::make(fitted, config.raymap, config.heads[0].fields, delivered_formats(config, heads)));
  NODAL_TRY(job.tables().check_budget());
  return job;
}

hal::ConfinedJob rehearsal_job(std::string json, const HeadShapes& heads) {
  return {text_of(heads), {json.begin(), json.end()}};
}

Result<std::vector<std::uint8_t>> rehearse(const RigConfig& config, const hal::ConfinedJob& job,
                                           const hal::ConfinedProgress& progress) {
  const HeadShapes heads = shapes_of(job.what);
  NODAL_TRY_ASSIGN(const auto calibration,
                   parse_calibration({reinterpret_cast<const char*>(job.input.data()), job.input.size()}));
  NODAL_TRY_ASSIGN(const auto fitted, fit_to_rig(calibration, config.heads, heads));
  NODAL_TRY_ASSIGN(auto work, plan_within_budget(fitted, config, heads));
  while (!work.tables().done()) {
    progress();
    work.tables().compile_some(CalibrationKeeper::kRowsAStep);
  }
  NODAL_TRY(std::move(work).finish({}));
  return std::vector<std::uint8_t>();
}

/// The document is stored and compiled here when a process that has nothing of the rig has come through with it.
Status CalibrationKeeper::rehearse(const CalibrationRequest& request) {
  const auto& upload = std::get<CalibrationRequest::Install>(request.what);
  NODAL_TRY(rehearsal_->begin(rehearsal_job(upload.json, request.heads)));
  installing_.emplace();
  installing_->rehearsed = request;
  report_.activity = "checking a calibration";
  return {};
}

bool CalibrationKeeper::end_rehearsal() {
  const auto result = rehearsal_->take_result();
  if (!result) return false;
  const CalibrationRequest request = *std::exchange(installing_->rehearsed, std::nullopt);
  installing_.reset();
  report_.activity.clear();
  Status begun = *result ? install(request) : Status(fail(result->error().in("calibration")));
  if (!begun) answer(request.ticket, fail(begun.error()));
  return true;
}

std::uint64_t rehearsal_bytes(const RigConfig& config) {
  const auto pixels =
      static_cast<std::uint64_t>(config.raymap.width) * static_cast<std::uint64_t>(config.raymap.height);
  return kMaxRehearsalBytes + kMaxRehearsalBytesAPixel * pixels;
}

}  // namespace nodal::firmware
