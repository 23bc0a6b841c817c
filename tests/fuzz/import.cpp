// Project files of other programs with any content: the result is a checked calibration, or an error with a message.
#include <cstdint>
#include <string_view>

#include "protocol/base/text.h"
#include "stitch/interchange/import.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  using Import = Result<interchange::ImportResult> (*)(std::string_view, std::string_view);
  for (const Import import : {&interchange::import_pto, &interchange::import_pts, &interchange::import_videostitch,
                              &interchange::import_surround360, &interchange::import_camera,
                              &interchange::import_kalibr, &interchange::import_project}) {
    const Result<interchange::ImportResult> result = import(text, "fuzz");
    if (!result) {
      NODAL_ASSERT(!result.error().message.empty());
      continue;
    }
    NODAL_ASSERT(check_calibration(result->calibration).has_value());
    NODAL_ASSERT(result->images.size() == result->calibration.heads.size());
    for (const std::string& note : result->notes) NODAL_ASSERT(is_printable(note) && note.ends_with('.'));
    // An imported calibration can be written and read again.
    const Result<Calibration> again = parse_calibration(to_json(result->calibration));
    NODAL_ASSERT(again.has_value());
    NODAL_ASSERT(calibration_id(*again) == calibration_id(result->calibration));
    for (const interchange::ControlPoint& point : result->control_points) {
      NODAL_ASSERT(point.head_a < again->heads.size() && point.head_b < again->heads.size());
    }
  }
  return 0;
}
