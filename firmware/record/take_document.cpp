// The part of TakeKeeper that says what a take is before its first set.
#include <fmt/format.h>

#include <algorithm>

#include "firmware/record/take_keeper.h"
#include "protocol/take/documents.h"
#include "protocol/take/limits.h"

namespace nodal::firmware {

/// What is larger than a reader takes is not recorded.
Status TakeKeeper::check_pictures(const HeadShapes& heads) const {
  for (std::size_t head = 0; head < heads.size() && head < config_.heads.size(); ++head) {
    if (!heads[head] || heads[head]->format == PixelFormat::kMjpeg) continue;
    const std::size_t bytes = packed_size(heads[head]->format, heads[head]->width, heads[head]->height);
    if (bytes <= take::kMaxTakePictureBytes) continue;
    return fail(
        Errc::kTooLarge,
        fmt::format("pictures of head '{}' have {} MB, and those of a take at most {}; choose a smaller size or "
                    "MJPEG in rig.toml",
                    config_.heads[head].name, bytes >> 20, take::kMaxTakePictureBytes >> 20));
  }
  return {};
}

/// What the configuration does not say.
void TakeKeeper::describe(take::TakeDocument& about, Instant now) const {
  about.software = software_;
  about.started_utc_ns = std::clamp<std::int64_t>(utc_(), 0, take::kMaxUtcNs);
  about.started_ns = now.ns();
  about.rate = rate_;
  about.raymaps_a_set = config_.raymap.raymaps_a_set();
}

}  // namespace nodal::firmware
