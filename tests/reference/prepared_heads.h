// Prepares heads' pictures for blend_rows, for tests that blend without a rig.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/blend/prepare.h"

namespace nodal::test {

class PreparedHeads {
 public:
  PreparedHeads(const blend::BlendTable& table, std::span<const ImageView> heads)
      : views_(heads.size() * blend::kMaxPictures) {
    std::vector<ImageView> levels(blend::kMaxPictures);
    for (std::size_t h = 0; h < heads.size(); ++h) {
      const blend::BlendTable::Source& source = table.sources[h];
      if (heads[h].planes[0].data == nullptr) continue;
      std::vector<std::uint8_t>& memory = memory_.emplace_back(blend::prepared_size(source));
      blend::prepare_picture(source, heads[h], memory.data(), levels);
      for (std::size_t l = 0; l < source.pictures(); ++l) views_[l * heads.size() + h] = levels[l];
    }
  }
  std::span<const ImageView> views() const { return views_; }

 private:
  std::vector<std::vector<std::uint8_t>> memory_;
  std::vector<ImageView> views_;
};

}  // namespace nodal::test
