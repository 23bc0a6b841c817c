// The heads of a calibration with one picture each: the light that a head recorded along a ray, for pages to show.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"
#include "stitch/registration/registration.h"

namespace nodal::host {

/// Threading: immutable. Ownership: refers to the frames and their bytes.
class PicturedHeads {
 public:
  /// Errors: those of geometry::make_heads.
  static Result<PicturedHeads> make(const Calibration& calibration, const registration::FrameSet& frames);

  const std::vector<geometry::Head>& heads() const { return heads_; }

  /// The light that a head recorded for a ray, without its gain and fall-off, 0..255; nothing outside its region.
  std::optional<double> light(std::size_t head, const geometry::Ray& ray) const;
  /// The same in red, green and blue.
  std::optional<std::array<double, 3>> colours(std::size_t head, const geometry::Ray& ray) const;
  /// The light encoded with the first head's response, for display.
  std::uint8_t shown(double light) const;

 private:
  /// A response curve by table, in steps of a quarter of a level: what pages show needs no more.
  class Curve {
   public:
    template <class F>
    explicit Curve(const F& curve) {
      for (std::size_t k = 0; k < kSteps; ++k) values_[k] = curve(static_cast<double>(k) / (kSteps - 1));
    }
    /// `level`: 0..255; others are clamped.
    double operator()(double level) const;

   private:
    static constexpr std::size_t kSteps = 4 * 255 + 1;
    std::array<double, kSteps> values_;
  };

  PicturedHeads(std::vector<geometry::Head> heads, const registration::FrameSet& frames);
  /// Where a head sees a ray.
  std::optional<geometry::Pixel> pixel(std::size_t head, const geometry::Ray& ray) const;

  std::vector<geometry::Head> heads_;
  const registration::FrameSet& frames_;
  std::vector<Curve> decode_;
  Curve encode_;  ///< takes the square root of light, which resolves dark values like the encoded ones
};

}  // namespace nodal::host
