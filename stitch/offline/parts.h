// Raymaps of more heads than a blend table can name: the raymap is cut into parts, each seen by few enough of them.
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::offline {

/// A raymap's blocks: squares of GridTable::kBlockTiles tiles. The blend computes each from its own tiles only.
struct Blocks {
  int across = 0;
  int down = 0;
  static Blocks of(int width, int height);
};

struct Part {
  std::vector<std::size_t> heads;  ///< heads that may see one of the part's rays, rising
  std::vector<bool> blocks;        ///< blocks that it holds, row by row
};

/// Cuts a raymap into parts of at most `most` heads; every block that a head may see is in exactly one part.
/// Errors: those of geometry::make_heads; kTooLarge, with the direction, where more heads see one block; kUnsupported
///   for layouts that are scattered.
Result<std::vector<Part>> cut_into_parts(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                         std::size_t most = kMaxHeads);

/// The calibration of a part's heads.
Calibration calibration_of(const Part& part, const Calibration& calibration);

/// The rays of a part's blocks.
///
/// Ownership: keeps its arguments by reference.
class PartLayout final : public geometry::RaymapLayout {
 public:
  PartLayout(const geometry::RaymapLayout& whole, const Part& part);
  std::string_view name() const override { return whole_.name(); }
  bool scattered() const override { return false; }
  bool smooth() const override { return whole_.smooth(); }
  std::optional<geometry::Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override { return whole_.solid_angle(i, j); }
  std::optional<geometry::Pixel> pixel(const geometry::Ray& ray) const override { return whole_.pixel(ray); }

 private:
  bool holds(int x, int y) const;

  const geometry::RaymapLayout& whole_;
  const Part& part_;
  Blocks blocks_;
};

/// Copies a part's blocks from one picture to another of the same format and size.
void copy_blocks(const Part& part, const ImageView& from, const MutableImageView& to);

}  // namespace nodal::offline
