// Dense registration of photographs with the known pattern (§4.3): fits lens and poses so that the pattern, projected
// through them, matches every pixel of the photographs.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/lens/photometry.h"
#include "stitch/calibration/lens/scale_space.h"
#include "stitch/calibration/lens/shading.h"
#include "stitch/calibration/lens/start.h"
#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/pieces.h"

namespace nodal::calibration {

/// The unknowns: lens, poses, and the blur of each photograph.
struct DenseState {
  Arrangement arrangement;
  std::vector<double> log_blur;  ///< ln of the Gaussian's sigma in px of the photograph
};

/// How much work a descent does.
struct Care {
  long most_pixels;  ///< over all photographs, evenly spread
  double sure;       ///< a step that lowers the cost by a smaller share is taken without evaluation, and is the last
  double still_px;   ///< a round that moves the picture by less is the last, px of the pyramid's level
};
inline constexpr Care kQuick{40'000, 2e-3, 0.02};      // accurate to a few hundredths of a pixel
inline constexpr Care kThorough{700'000, 3e-4, 2e-3};  // more pixels do not improve the result

/// The quality of a photograph's fit.
struct DenseFit {
  double explained = 0;  ///< share of the photograph's variance that the fit explains, where it shows the pattern
  double rms = 0;        ///< rms of the residuals, for a range of 1
  double covered = 0;    ///< share of the region's pixels that show the pattern
};

/// Residuals and light of the photographs for one state.
struct DenseSurvey {
  std::vector<DenseFit> fits;
  std::vector<GreyImage> residuals;  ///< residuals by pixel; 0 where the pattern is not seen
  /// Light samples of the photographs, only where the pattern is smooth over a pixel or two, so that errors of the blur
  /// model do not affect them.
  std::vector<std::vector<LightSample>> calm;
  double covered = 0;  ///< share of the region in which at least one photograph shows the pattern
  /// Distances from the lens's centre between which they show it, px of the picture, aspect taken out.
  double seen_from_px = 0, seen_to_px = 0;
};

/// Threading: thread-bound; `for_each` may distribute the work. Ownership: keeps the photographs' pyramids; refers to
/// the pattern, which must outlive it.
class DenseAlignment {
 public:
  DenseAlignment(const ScaleSpace& pattern, const std::vector<GreyImage>& photos, Region region,
                 solve::ForEach for_each);

  /// Descends at one pyramid level (0: full size) and refits the shading after each round; returns the last evaluation.
  /// `fixed_lens` marks lens parameters that are held.
  solve::Evaluation run(int level, const Care& care, const std::vector<bool>& fixed_lens, DenseState& state);
  /// The coarsest pyramid level.
  int coarsest() const { return static_cast<int>(pyramids_[0].size()) - 1; }

  /// Residuals for the pixels and the shading of the last run.
  DenseSurvey survey(const DenseState& state) const;

  static constexpr int kOwn = 7;  // unknowns of one photograph: six of the pose, one of the blur

 private:
  struct Look;
  struct Seen;
  bool see(const Look& look, const Sight& sight, Seen& seen) const;
  void fit_shading(const DenseState& state);
  solve::Evaluation evaluate(const DenseState& state) const;
  /// Calls `take` for every pixel of a band that shows the pattern (in a row only every `every`-th), one photograph
  /// after the other.
  void gather(const DenseState& state, int band, const std::function<void(std::size_t view, const Seen&)>& take,
              int every = 1) const;
  void set_level(int level, long most_pixels);
  bool in_region(const geometry::Pixel& pixel, double margin) const;

  const ScaleSpace& pattern_;
  std::vector<std::vector<GreyImage>> pyramids_;
  Region region_;
  solve::ForEach for_each_;
  Shadings shadings_;
  int level_ = 0;
  int stride_ = 1;
};

/// The covariance of the unknowns at the end of a run, from the residuals; lens parameters come first.
Eigen::MatrixXd covariance(const solve::Evaluation& end, std::vector<bool> fixed_lens);

}  // namespace nodal::calibration
