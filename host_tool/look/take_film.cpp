#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "host_tool/look/film.h"
#include "host_tool/offload/take_files.h"
#include "protocol/base/try.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::host::look {
namespace {

class TakeFilm final : public Film {
 public:
  TakeFilm(std::string name, media::TakeFolder folder) : name_(std::move(name)), folder_(std::move(folder)) {}

  /// Finds the raymaps of all segments.
  Status index() {
    layout_ = folder_.about().layout;
    media::SetsBefore before;
    for (std::size_t k = 0; k < folder_.segments(); ++k) {
      before_.push_back(before);
      NODAL_TRY_ASSIGN(const media::TakeSegment segment, folder_.segment(k, before));
      before = segment.after();
      const auto file = std::ranges::find_if(segment.streams(), [](const auto& each) { return !each.head; });
      if (file == segment.streams().end()) continue;
      if (file->stream.lossless || file->stream.format != PixelFormat::kMjpeg || file->fields_apart)
        return fail(Errc::kUnsupported, name_ + ": its raymaps are no JPEGs; `nodal render` makes a film of them");
      const auto number = static_cast<std::uint32_t>(file - segment.streams().begin());
      for (const take::wire::Raymap& raymap : segment.evidence().raymaps) {
        if (frames_.empty()) first_ns_ = raymap.mid_exposure_ns();
        times_.push_back(std::max(times_.empty() ? 0 : times_.back(), raymap.mid_exposure_ns() - first_ns_));
        frames_.push_back({k, number, raymap.at(), raymap.bytes()});
      }
    }
    if (!frames_.empty()) return {};
    return fail(Errc::kNotFound,
                fmt::format("{}: no raymaps were recorded with this take; `nodal look --heads {}` shows its heads, "
                            "and `nodal render {}` makes a film",
                            name_, name_, name_));
  }

  Result<std::vector<std::uint8_t>> frame(std::size_t k) override {
    const Frame& frame = frames_[k];
    if (!segment_ || open_ != frame.segment) {
      segment_.reset();
      NODAL_TRY_ASSIGN(media::TakeSegment segment, folder_.segment(frame.segment, before_[frame.segment]));
      segment_ = std::move(segment);
      open_ = frame.segment;
    }
    std::vector<std::uint8_t> bytes;
    NODAL_TRY(segment_->read(frame.file, frame.at, frame.bytes, bytes));
    return bytes;
  }

 private:
  struct Frame {
    std::size_t segment = 0;
    std::uint32_t file = 0;
    std::uint64_t at = 0, bytes = 0;
  };

  std::string name_;
  media::TakeFolder folder_;
  std::vector<media::SetsBefore> before_;  // what comes before each segment
  std::vector<Frame> frames_;
  std::int64_t first_ns_ = 0;
  std::optional<media::TakeSegment> segment_;  // the one that was read last
  std::size_t open_ = 0;
};

}  // namespace

Result<std::unique_ptr<Film>> open_take_raymaps(const std::string& folder) {
  NODAL_TRY_ASSIGN(media::TakeFolder opened, media::TakeFolder::open(take_files(folder)));
  auto film = std::make_unique<TakeFilm>(folder, std::move(opened));
  NODAL_TRY(film->index());
  return film;
}

}  // namespace nodal::host::look
