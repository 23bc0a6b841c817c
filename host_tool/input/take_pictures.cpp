#include "host_tool/input/take_pictures.h"

#include <algorithm>
#include <memory>

#include "host_tool/input/take_heads.h"
#include "protocol/base/try.h"

namespace nodal::host {

Result<RigPictures> take_pictures(const std::string& folder, int sets) {
  NODAL_TRY_ASSIGN(const std::unique_ptr<TakeHeads> take, TakeHeads::open(folder));
  RigPictures rig;
  rig.origin = RigPictures::Origin::kPictures;
  rig.heads = take->heads();
  const std::size_t whole = take->times().size(), count = std::min(static_cast<std::size_t>(sets), whole);
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<HeadPicture>& pictures = rig.sets.emplace_back();
    for (std::size_t head = 0; head < rig.heads.size(); ++head) {
      NODAL_TRY_ASSIGN(DecodedImage picture, take->picture((2 * k + 1) * whole / (2 * count), head));
      pictures.emplace_back(std::move(picture));
    }
  }
  return rig;
}

}  // namespace nodal::host
