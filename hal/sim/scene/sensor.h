// A head's electronics, from light to values: exposure, gain, white balance, noise, response, clipping, eight bits, and
// the head's pixel format.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "hal/head.h"
#include "hal/sim/scene/lens.h"
#include "hal/sim/scene/packing.h"
#include "hal/sim/scene/plate.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// Noise of the sensor. All zero: none.
struct NoiseModel {
  double levels = 0;               ///< standard deviation in levels of 255, for every encoded value
  double full_well_electrons = 0;  ///< light 1 at 0 dB in electrons, for shot noise; 0: no shot noise
  double read_electrons = 0;       ///< standard deviation
};

struct SensorOptions {
  PixelFormat pixels = PixelFormat::kI420;  ///< not kMjpeg; YUV is full range BT.601, as in JPEG
  bool interlaced = false;
  Duration half_period;                                 ///< from an interlaced head's first field to its second
  Exposure reference = Exposure::microseconds(10'000);  ///< light 1 fills a pixel with this exposure and 0 dB
  int supersampling = 2;                                ///< n x n samples per pixel
  NoiseModel noise;
};

/// Renders frames. The static scene is rendered once per setting, in a few versions with different noise, and copied;
/// movers are drawn over it. So ten 720x480 heads need a small part of one core.
///
/// Threading: thread-bound, except that different sensors share nothing.
/// Ownership: none; the scene is shared.
/// Errors: none.
class Sensor {
 public:
  Sensor(const HeadCalibration& truth, const SensorOptions& options, ScenePtr scene, std::uint64_t seed);

  /// Computes everything that does not depend on settings.
  void prepare();

  /// Renders frame `number` for the given settings and time, packed, into `into` (packed_size() bytes). `holds` is the
  /// return value of the earlier call that wrote the present content of `into`, 0 for none: bytes that would be the
  /// same are not written again. In a frame of an interlaced head, the first field by `fields` is exposed at
  /// mid_exposure, the other one half a period later.
  std::uint64_t render(const HeadSettings& settings, Instant mid_exposure, std::uint32_t number,
                       std::span<std::uint8_t> into, std::uint64_t holds, Fields fields = Fields::kProgressive);
  /// Factor on the scene's light, for frames rendered from now on.
  void set_light(double factor);

 private:
  struct Curve {  ///< light to values for one setting
    std::array<float, 3> scale{};
    std::array<float, 3> shot{};  ///< variance per light
    std::array<float, 3> read{};  ///< variance
    float levels = 0;             ///< standard deviation in 1/128 levels
  };
  struct Rect {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  };
  using Movers = std::vector<PlacedMover>;

  void use(const HeadSettings& settings);
  void make_curve(Gamma gamma);
  void develop(const Rect& rect, std::uint32_t version, std::span<const PlacedMover> top,
               std::span<const PlacedMover> bottom, const MutableImageView& into);
  void develop_pair(int y, int step, int x0, int x1, std::uint32_t version, std::span<const PlacedMover> movers,
                    RowPair& pair);
  void develop_row(int y, int x0, int x1, std::uint32_t version, std::span<const PlacedMover> movers,
                   std::array<std::int16_t*, 3> out);
  void paint_movers(int y, int x0, std::size_t count, std::span<const PlacedMover> movers);
  bool any_touches(const Movers& top, const Movers& bottom) const;
  void draw_touched(const Movers& top, const Movers& bottom, std::uint32_t number, const MutableImageView& into);

  struct Block {
    Direction middle;
    bool sees = false;            ///< whether it sees anything
    double cosine = 1, sine = 0;  ///< cosine and sine of the angle around `middle` that holds all that the block sees
  };

  const HeadCalibration truth_;
  const SensorOptions options_;
  const ScenePtr scene_;
  const std::uint64_t seed_;
  LensTruth lens_;

  bool prepared_ = false;
  Plate plate_;
  std::vector<Block> blocks_;
  std::vector<std::uint16_t> encoded_;  ///< the response in 1/128 levels, indexed by the square root of light
  std::vector<float> normal_;           ///< standard normal deviates

  double light_ = 1;
  std::optional<HeadSettings> settings_;
  Gamma curve_is_of_;  ///< the gamma that `encoded_` is for
  Curve curve_;
  std::uint64_t still_id_ = 0;                       ///< identity of versions_[0] under these settings
  std::vector<std::vector<std::uint8_t>> versions_;  ///< versions of the static part; those in use come first
  std::size_t versions_ready_ = 0;
  std::optional<std::uint32_t> last_number_;
  std::vector<float> light_row_;
  std::vector<std::int16_t> rows_;
};

}  // namespace nodal::hal::sim
