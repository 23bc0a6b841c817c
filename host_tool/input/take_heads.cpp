#include "host_tool/input/take_heads.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "host_tool/input/head_frame.h"
#include "host_tool/offload/take_files.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"

namespace nodal::host {

bool is_take(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(std::filesystem::path(path) / take::kTakeFile, error);
}

Result<std::unique_ptr<TakeHeads>> TakeHeads::open(const std::string& folder) {
  NODAL_TRY_ASSIGN(media::TakeFolder take, media::TakeFolder::open(take_files(folder)));
  std::unique_ptr<TakeHeads> made(new TakeHeads(folder, std::move(take)));
  NODAL_TRY(made->find_sets());
  return made;
}

Status TakeHeads::find_sets() {
  if (heads().empty()) return fail(Errc::kBadFormat, folder_.shown(take::kTakeFile) + ": names no head");
  std::vector<std::uint64_t> lacks(heads().size());  // sets without a picture of the head
  media::TakeSet set;
  std::int64_t first = 0;
  while (true) {
    NODAL_TRY_ASSIGN(const bool more, sets_.next(set));
    if (!more) break;
    bool whole = true;
    for (std::size_t head = 0; head < lacks.size(); ++head) {
      if (set.heads[head].present && set.heads[head].placeholder.empty()) continue;
      ++lacks[head];
      whole = false;
    }
    if (!whole) continue;
    if (places_.empty()) first = set.mid_exposure.ns();
    times_.push_back(std::max(times_.empty() ? 0 : times_.back(), set.mid_exposure.ns() - first));
    places_.push_back(sets_.place());
  }
  if (!places_.empty()) return {};
  const auto worst = std::ranges::max_element(lacks);
  return fail(Errc::kNotFound,
              fmt::format("{}: no set has a picture of every head; head '{}' has none in {} of {}", name_,
                          heads()[static_cast<std::size_t>(worst - lacks.begin())], *worst, folder_.manifest().sets));
}

Result<Calibration> TakeHeads::calibration() const {
  std::string file = folder_.has(take::kCalibrationFile) ? take::kCalibrationFile : "";
  for (const take::Manifest::Calibration& later : folder_.manifest().calibrations) {
    if (later.stored()) file = later.file;
  }
  if (file.empty()) {
    return fail(Errc::kNotReady, folder_.shown(take::kCalibrationFile) +
                                     ": the take has no calibration; give one before the take: rig.json " + name_);
  }
  NODAL_TRY_ASSIGN(const std::string text, folder_.text(file, kMaxCalibrationBytes));
  auto parsed = parse_calibration(text);
  if (!parsed) return fail(parsed.error().in(folder_.shown(file)));
  return parsed;
}

Status TakeHeads::read(std::size_t set, std::size_t head) {
  if (!any_read_ || read_ != set) {
    any_read_ = false;
    NODAL_TRY(sets_.go_to(places_[set]));
    NODAL_TRY_ASSIGN(const bool more, sets_.next(set_));
    if (!more) return fail(Errc::kChecksum, name_ + ": the take changes while it is read; try again");
    read_ = set;
    any_read_ = true;
  }
  return sets_.read_picture(set_, head);
}

Result<DecodedImage> TakeHeads::picture(std::size_t set, std::size_t head) {
  NODAL_TRY(read(set, head));
  return picture_of_frame(set_.heads[head].image, heads()[head]);
}

Result<std::vector<std::uint8_t>> TakeHeads::jpeg(std::size_t set, std::size_t head) {
  NODAL_TRY(read(set, head));
  if (set_.heads[head].image.format != PixelFormat::kMjpeg) return std::vector<std::uint8_t>{};
  return set_.bytes[head];
}

}  // namespace nodal::host
