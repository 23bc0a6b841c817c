// Dense registration of photographs with the known pattern (§4.3): every pixel pulls on the lens and on its
// photograph's pose until the pattern, seen through them, is the photograph.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/lens/levenberg_marquardt.h"
#include "stitch/calibration/lens/scale_space.h"
#include "stitch/calibration/lens/shading.h"
#include "stitch/calibration/lens/start.h"

namespace nodal::calibration {

/// Calls work(0) .. work(count - 1), in any order, at once or one by one. Who owns threads passes one that uses
/// them; the results are the same.
using ForEach = std::function<void(int count, const std::function<void(int)>& work)>;
void one_by_one(int count, const std::function<void(int)>& work);

/// What is sought: lens, poses, and how sharp each photograph is.
struct DenseState {
  Arrangement arrangement;
  std::vector<double> log_blur;  ///< ln of the Gaussian's sigma, px of the photograph
};

/// How well a photograph is explained.
struct DenseFit {
  double explained = 0;  ///< part of the photograph's variance, where it shows the pattern
  double rms = 0;        ///< of what is left, of a range of 1
  double covered = 0;    ///< part of the region's pixels that show the pattern
  long pixels = 0;       ///< that took part
};

/// Threading: thread-bound; `for_each` may spread the work.
/// Ownership: keeps the photographs' pyramids; the pattern must outlive it.
class DenseAlignment {
 public:
  DenseAlignment(const ScaleSpace& pattern, const std::vector<GreyImage>& photos, Region region, ForEach for_each);

  /// Descends at one pyramid level (0: full size) on about so many pixels of all photographs together, spread evenly;
  /// shading refitted as it goes. `fixed_lens` marks lens parameters that stay.
  void run(int level, long most_pixels, const std::vector<bool>& fixed_lens, DenseState& state);
  /// Coarsest level worth using.
  int coarsest() const { return static_cast<int>(pyramids_[0].size()) - 1; }

  /// How each photograph is explained at the last state.
  std::vector<DenseFit> fits(const DenseState& state) const;
  /// The part of the region that at least one photograph shows the pattern in.
  double covered(const DenseState& state) const;
  /// The covariance of the unknowns at the last state, from what is left unexplained; lens parameters first.
  Eigen::MatrixXd covariance(const DenseState& state, const std::vector<bool>& fixed_lens) const;
  /// What the model leaves unexplained of photograph `view`, px for px; 0 where the pattern is not seen.
  GreyImage residual_map(int view, const DenseState& state) const;
  /// What photograph `view` shows of the pattern: calls back with the pixel, the pattern's light and the
  /// photograph's value. Only where the pattern is calm over a pixel or two, so that how blur is modelled does
  /// not colour the light.
  void each_calm_pixel(int view, const DenseState& state, int stride,
                  const std::function<void(double x, double y, double light, double value)>& tell) const;

  static constexpr int kOwn = 7;  // six of the pose, one of the blur
  static constexpr long kMostPixels = 700'000;  // more do not make it better
  static constexpr long kFewPixels = 120'000;   // enough to come within a hundredth of a pixel

 private:
  struct Seen;
  bool see(const DenseState& state, std::size_t view, const PlaneFinder& plane, const Sight& sight, Seen& seen) const;
  void fit_shading(const DenseState& state);
  Evaluation evaluate(const DenseState& state) const;
  /// Calls back with every pixel of a band that shows the pattern (of a row only `every` so many-th), in all photographs
  /// or in `only` one.
  void gather(const DenseState& state, int band, const std::function<void(std::size_t view, const Seen&)>& take,
              int only = -1, int every = 1) const;
  void set_level(int level, long most_pixels);
  bool in_region(const geometry::Pixel& pixel, double margin) const;

  const ScaleSpace& pattern_;
  std::vector<std::vector<GreyImage>> pyramids_;
  Region region_;
  ForEach for_each_;
  Shadings shadings_;
  int level_ = 0;
  int stride_ = 1;
};

}  // namespace nodal::calibration
