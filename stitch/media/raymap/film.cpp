#include "stitch/media/raymap/film.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "protocol/base/try.h"
#include "protocol/base/version.h"
#include "protocol/take/limits.h"
#include "stitch/media/gpano.h"

namespace nodal::media {

/// Nothing if it is not known, or before 1970.
std::optional<std::int64_t> Film::utc_of(std::uint64_t frame_ns) const {
  using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::system_clock;
  if (live_) return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
  if (!utc_offset_ns_) return std::nullopt;
  const __int128 utc = static_cast<__int128>(*utc_offset_ns_) + frame_ns;
  if (utc < 0 || utc > take::kMaxUtcNs) return std::nullopt;
  return static_cast<std::int64_t>(utc);
}

Status Film::write(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at) const {
  const Status written = write_(bytes, at);
  if (written) return {};
  return fail(written.error().code, fmt::format("{}; it plays up to about frame {}", written.error().message, frames_));
}

Status Film::write_cluster() {
  if (open_.empty()) return {};
  std::vector<take::Block> blocks;
  for (const Frame& each : open_) blocks.push_back({each.since_start, each.bytes});
  Status written;
  for (const auto& piece : writer_->cluster(blocks).pieces) {
    if (written) written = write(piece);
  }
  open_.clear();
  open_bytes_ = 0;
  return written;
}

Status Film::add(const Raymap& raymap) {
  take::VideoTrack track;
  track.width = raymap.meta.width;
  track.height = raymap.meta.height;
  track.equirectangular = is_whole_sphere(raymap.meta.layout);
  track.rate = raymap.meta.rate;
  return add(track, raymap.meta.mid_exposure_ns, raymap.bytes);
}

Status Film::add(const take::VideoTrack& track, std::uint64_t now_ns, std::span<const std::uint8_t> frame) {
  if (!writer_) {
    width_ = track.width;
    height_ = track.height;
    take::VideoTrack ours = track;
    ours.writer = "nodal " NODAL_VERSION;
    ours.utc_ns = utc_of(now_ns);
    writer_.emplace(ours);
    first_ns_ = now_ns;
    NODAL_TRY(write(writer_->head()));
  }
  if (track.width != width_ || track.height != height_) {
    return fail(Errc::kBadFormat, fmt::format("{}: frame {} has {}x{} pixels, and the film has {}x{}", name_, frames_,
                                              track.width, track.height, width_, height_));
  }
  constexpr std::uint64_t kLongestFilm = INT64_MAX / 4;  // 73 years
  const std::uint64_t since = now_ns > first_ns_ ? std::min(now_ns - first_ns_, kLongestFilm) : 0;
  newest_ns_ = std::max(newest_ns_, static_cast<std::int64_t>(since));
  ++frames_;
  const take::Block next{Duration::nanoseconds(newest_ns_), frame};
  if (!open_.empty() && take::MatroskaWriter::cluster_full(open_bytes_, open_.front().since_start, next)) {
    NODAL_TRY(write_cluster());
  }
  open_.push_back({next.since_start, {frame.begin(), frame.end()}});
  open_bytes_ += frame.size();
  return {};
}

void Film::set_utc_offset(std::optional<std::int64_t> offset_ns) {
  live_ = false;
  utc_offset_ns_ = offset_ns;
}

Status Film::end() {
  if (ended_ || !writer_) return {};
  ended_ = true;
  NODAL_TRY(write_cluster());
  NODAL_TRY(write(writer_->end()));
  return write(writer_->sector(), take::MatroskaWriter::kSectorAt);
}

}  // namespace nodal::media
