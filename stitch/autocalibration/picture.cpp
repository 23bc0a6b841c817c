#include "stitch/autocalibration/picture.h"

#include <algorithm>

namespace nodal::autocalibration {

Picture reduced(const DecodedImage& picture, int side) {
  const int by = (std::max(picture.width, picture.height) + side - 1) / side;
  Picture small{picture.width / by, picture.height / by, {}};
  small.values.reserve(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height));
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      int sum = 0;
      for (int j = 0; j < by; ++j) {
        const std::uint8_t* row =
            picture.bytes.data() + static_cast<std::size_t>(y * by + j) * static_cast<std::size_t>(picture.width);
        for (int i = 0; i < by; ++i) sum += row[x * by + i];
      }
      small.values.push_back(static_cast<float>(sum) / static_cast<float>(by * by));
    }
  }
  return small;
}

}  // namespace nodal::autocalibration
