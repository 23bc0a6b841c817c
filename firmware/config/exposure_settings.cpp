#include "firmware/config/exposure_settings.h"

namespace nodal::firmware {

std::string_view exposure_program_name(ExposureProgram program) {
  switch (program) {
    case ExposureProgram::kManual: return "manual";
    case ExposureProgram::kEach: return "each";
    case ExposureProgram::kJoint: return "joint";
  }
  return "unknown";
}

std::optional<ExposureProgram> exposure_program_of(std::string_view name) {
  for (const auto program : {ExposureProgram::kManual, ExposureProgram::kEach, ExposureProgram::kJoint}) {
    if (name == exposure_program_name(program)) return program;
  }
  return std::nullopt;
}

ExposureSettings ExposureChange::applied_to(ExposureSettings settings) const {
  settings.program = program.value_or(settings.program);
  settings.anchor = anchor.value_or(settings.anchor);
  settings.target = target.value_or(settings.target);
  settings.difference = difference.value_or(settings.difference);
  settings.ramp = ramp.value_or(settings.ramp);
  settings.longest = longest.value_or(settings.longest);
  settings.highest = highest.value_or(settings.highest);
  settings.locked = locked.value_or(settings.locked);
  return settings;
}

void ExposureChange::add(const ExposureChange& newer) {
  const auto over = [](auto& value, const auto& newer_value) {
    if (newer_value) value = newer_value;
  };
  over(program, newer.program);
  over(anchor, newer.anchor);
  over(target, newer.target);
  over(difference, newer.difference);
  over(ramp, newer.ramp);
  over(longest, newer.longest);
  over(highest, newer.highest);
  over(locked, newer.locked);
}

}  // namespace nodal::firmware
