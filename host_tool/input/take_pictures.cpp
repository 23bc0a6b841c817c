#include "host_tool/input/take_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "host_tool/input/head_frame.h"
#include "host_tool/offload/take_files.h"
#include "protocol/base/try.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::host {
namespace {

bool has_picture(const media::TakeFrame& frame) { return frame.present && frame.placeholder.empty(); }

/// The sets of a take in which every head has a picture.
struct WholeSets {
  std::vector<std::uint64_t> index;  ///< rising, as in the take
  std::vector<std::uint64_t> lacks;  ///< by head: sets without a picture of it
};

Result<WholeSets> whole_sets(const media::TakeFolder& take) {
  WholeSets found;
  found.lacks.resize(take.about().heads.size());
  media::TakeSets sets(take);
  media::TakeSet set;
  while (true) {
    NODAL_TRY_ASSIGN(const bool more, sets.next(set));
    if (!more) return found;
    bool whole = true;
    for (std::size_t head = 0; head < found.lacks.size(); ++head) {
      if (has_picture(set.heads[head])) continue;
      ++found.lacks[head];
      whole = false;
    }
    if (whole) found.index.push_back(set.evidence.index());
  }
}

}  // namespace

bool is_take(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(std::filesystem::path(path) / take::kTakeFile, error);
}

Result<RigPictures> take_pictures(const std::string& folder, int sets) {
  NODAL_TRY_ASSIGN(const media::TakeFolder take, media::TakeFolder::open(take_files(folder)));
  RigPictures rig;
  rig.origin = RigPictures::Origin::kPictures;
  rig.heads = take.about().heads;
  if (rig.heads.empty()) return fail(Errc::kBadFormat, take.shown(take::kTakeFile) + ": names no head");
  NODAL_TRY_ASSIGN(const WholeSets whole, whole_sets(take));
  if (whole.index.empty()) {
    const auto worst = std::ranges::max_element(whole.lacks);
    return fail(Errc::kNotFound, fmt::format("{}: no set has a picture of every head; head '{}' has none in {} of {}",
                                             folder, rig.heads[static_cast<std::size_t>(worst - whole.lacks.begin())],
                                             *worst, take.manifest().sets));
  }
  const std::size_t count = std::min(static_cast<std::size_t>(sets), whole.index.size());
  media::TakeSets all(take);
  media::TakeSet set;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint64_t wanted = whole.index[(2 * k + 1) * whole.index.size() / (2 * count)];
    do {
      NODAL_TRY_ASSIGN(const bool more, all.next(set));
      if (!more) return fail(Errc::kChecksum, folder + ": the take changes while it is read; try again");
    } while (set.evidence.index() < wanted);
    NODAL_TRY(all.read_pictures(set));
    std::vector<HeadPicture>& pictures = rig.sets.emplace_back();
    for (std::size_t head = 0; head < rig.heads.size(); ++head) {
      NODAL_TRY_ASSIGN(DecodedImage picture, picture_of_frame(set.heads[head].image, rig.heads[head]));
      pictures.emplace_back(std::move(picture));
    }
  }
  return rig;
}

}  // namespace nodal::host
