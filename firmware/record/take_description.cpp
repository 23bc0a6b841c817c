#include "firmware/record/take_description.h"

#include <fmt/format.h>

#include <algorithm>

#include "firmware/record/head_coder.h"
#include "protocol/base/text.h"
#include "protocol/take/documents.h"
#include "protocol/take/limits.h"

namespace nodal::firmware {

TakeWriter::Documents documents_of(const RigConfig& config, const TakeRequest::Start& start) {
  TakeWriter::Documents documents;
  documents.about.rig = printable(config.name, take::kMaxTakeTextBytes);
  documents.about.mode = mode_names(config.heads);
  documents.about.raymaps_a_set = config.raymap.raymaps_a_set();
  if (start.calibration) documents.about.calibration_id = to_hex(*start.calibration);
  documents.calibration = start.calibration;
  for (const HeadConfig& head : config.heads)
    documents.about.heads.push_back(printable(head.name, take::kMaxTakeTextBytes));
  documents.calibration_json = start.calibration_json;
  if (config.text) documents.rig_toml = *config.text;
  if (config.takes->raymap && start.calibration) {
    documents.about.layout = config.raymap.layout;
    documents.raymap_width = config.raymap.width;
    documents.raymap_height = config.raymap.height;
  }
  return documents;
}

Status check_pictures(const RigConfig& config, const HeadShapes& heads) {
  for (std::size_t head = 0; head < heads.size() && head < config.heads.size(); ++head) {
    if (!heads[head] || heads[head]->format == PixelFormat::kMjpeg) continue;
    const std::size_t bytes = packed_size(heads[head]->format, heads[head]->width, heads[head]->height);
    if (bytes <= take::kMaxTakePictureBytes) continue;
    return fail(
        Errc::kTooLarge,
        fmt::format("pictures of head '{}' have {} MB, and those of a take at most {}; choose a smaller size or "
                    "MJPEG in rig.toml",
                    config.heads[head].name, bytes >> 20, take::kMaxTakePictureBytes >> 20));
  }
  return {};
}

std::uint64_t set_bytes(const RigConfig& config, const HeadShapes& heads, std::optional<TakeMode> mode) {
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < heads.size(); ++k) {
    if (!heads[k]) continue;
    const take::Stream delivered{heads[k]->format, heads[k]->width, heads[k]->height, {}, Fields::kProgressive, false};
    const take::Stream stored =
        stored_stream(delivered, mode.value_or(config.heads[k].take_mode), config.raymap.format);
    // A camera's JPEG has about one bit per sample, one of quality 90 about two; the first sets tell more.
    const bool as_sent = delivered.format == PixelFormat::kMjpeg;
    if (stored.format != PixelFormat::kMjpeg) sum += packed_size(stored.format, stored.width, stored.height);
    else if (as_sent) sum += packed_size(PixelFormat::kI420, stored.width, stored.height) / 8;
    else sum += packed_size(delivered.format, delivered.width, delivered.height) / 4;
  }
  return sum;
}

}  // namespace nodal::firmware
