// Dense registration of photographs with the known pattern (§4.3): every pixel pulls on the lens and on its
// photograph's pose until the pattern, seen through them, is the photograph.
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

/// What is sought: lens, poses, and how sharp each photograph is.
struct DenseState {
  Arrangement arrangement;
  std::vector<double> log_blur;  ///< ln of the Gaussian's sigma, px of the photograph
};

/// How much trouble a descent takes.
struct Care {
  long most_pixels;  ///< of all photographs together, spread evenly
  double sure;       ///< part of the cost below which a step is taken unseen, as the round's last
  double still_px;   ///< a round that moves the picture less is the last, px of the pyramid's level
};
inline constexpr Care kQuick{40'000, 2e-3, 0.02};      // comes within a few hundredths of a pixel
inline constexpr Care kThorough{700'000, 3e-4, 2e-3};  // more pixels do not make it better

/// How well a photograph is explained.
struct DenseFit {
  double explained = 0;  ///< part of the photograph's variance, where it shows the pattern
  double rms = 0;        ///< of what is left, of a range of 1
  double covered = 0;    ///< part of the region's pixels that show the pattern
};

/// What a state makes of the photographs.
struct DenseSurvey {
  std::vector<DenseFit> fits;
  std::vector<GreyImage> residuals;  ///< what is left unexplained, px for px; 0 where the pattern is not seen
  /// Light the photographs show. Only where the pattern is calm over a pixel or two, so that how blur is modelled does
  /// not colour it.
  std::vector<std::vector<LightSample>> calm;
  double covered = 0;  ///< the part of the region that at least one photograph shows the pattern in
};

/// Threading: thread-bound; `for_each` may spread the work.
/// Ownership: keeps the photographs' pyramids; the pattern must outlive it.
class DenseAlignment {
 public:
  DenseAlignment(const ScaleSpace& pattern, const std::vector<GreyImage>& photos, Region region,
                 solve::ForEach for_each);

  /// Descends at one pyramid level (0: full size), shading refitted as it goes; says what it ends with.
  /// `fixed_lens` marks lens parameters that stay.
  solve::Evaluation run(int level, const Care& care, const std::vector<bool>& fixed_lens, DenseState& state);
  /// Coarsest level worth using.
  int coarsest() const { return static_cast<int>(pyramids_[0].size()) - 1; }

  /// Of the last run's pixels and shading.
  DenseSurvey survey(const DenseState& state) const;

  static constexpr int kOwn = 7;  // six of the pose, one of the blur

 private:
  struct Look;
  struct Seen;
  bool see(const Look& look, const Sight& sight, Seen& seen) const;
  void fit_shading(const DenseState& state);
  solve::Evaluation evaluate(const DenseState& state) const;
  /// Calls back with every pixel of a band that shows the pattern (of a row only `every` so many-th), photograph by
  /// photograph.
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

/// The covariance of the unknowns where a run ended, from what is left unexplained; lens parameters first.
Eigen::MatrixXd covariance(const solve::Evaluation& end, std::vector<bool> fixed_lens);

}  // namespace nodal::calibration
