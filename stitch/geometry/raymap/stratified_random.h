// The stratified random raymap (§5).
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::geometry {

/// Row j is a slice of equal area, sin phi in [2 j / H - 1, 2 (j + 1) / H - 1] (the printed arcsin is of a number in
/// [-1, 1]). Its W rays have random theta, sorted, and a random place within the slice. All numbers follow from the
/// seed by integer arithmetic, so that board and host agree. A pixel spans the slice half way to its neighbours in
/// theta.
class StratifiedRandom final : public ScatteredRays {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t seed);
  std::string_view name() const override { return "stratified_random"; }
  double solid_angle(int i, int j) const override;

 protected:
  Ray ray_of(int i, int j) const override;

 private:
  StratifiedRandom(RaymapSize size, std::uint64_t seed);
  /// In parts of 2^-32 of a turn from straight behind.
  const std::uint32_t& turn(int i, int j) const {
    return turns_[static_cast<std::size_t>(j) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(i)];
  }

  std::uint64_t seed_;
  std::vector<std::uint32_t> turns_;  ///< row by row
};

}  // namespace nodal::geometry
