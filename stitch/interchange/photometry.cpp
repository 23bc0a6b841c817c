#include "stitch/interchange/photometry.h"

#include <algorithm>
#include <cmath>

namespace nodal::interchange {
namespace {

/// Light from encoded value in Hugin's response for Ra..Re = 0, EMoR's mean over many cameras: a polynomial fitted to
/// nona 2022's output for a ramp at eight exposures from -2 to 4 stops, to 0.08 levels of 255 rms.
constexpr std::array kMeanResponse{0.104165639,   2.518528026,    -12.713087053, 45.847686835, -107.436831174,
                                   161.911780617, -147.637115033, 74.004003159,  -15.599131016};

Response response_of(const Photometry& p, bool needed) {
  switch (p.response) {
    case ForeignResponse::kLinear: return {};
    case ForeignResponse::kGamma: return {Response::Curve::kGamma, p.gamma, {}};
    case ForeignResponse::kMean: break;
  }
  if (!needed) return {};
  return {Response::Curve::kPolynomial, 1, {kMeanResponse.begin(), kMeanResponse.end()}};
}

}  // namespace

void set_photometry(std::span<const Photometry> all, ImportResult& result) {
  double mean = 0;
  for (const Photometry& p : all) mean += p.stops / static_cast<double>(all.size());
  // A mean response matters only if there are exposures or vignetting to compensate.
  bool needed = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Photometry& p = all[i];
    HeadCalibration& head = result.calibration.heads[i];
    const double gain = std::exp2(mean - p.stops);
    for (std::size_t c = 0; c < 3; ++c) head.gain[c] = gain * p.balance[c];
    head.vignetting = {head.width / 2.0 + p.Vx,
                       head.height / 2.0 + p.Vy,
                       p.radius,
                       {p.V[1] / p.V[0], p.V[2] / p.V[0], p.V[3] / p.V[0]}};
    if (!check_head(head) && p.falls_off()) {
      head.vignetting.coefficients = {};
      result.notes.push_back("The vignetting of head '" + head.name + "' goes dark inside its picture: left out.");
    }
    needed = needed || p.falls_off() || p.fitted || std::abs(gain - 1) > 1e-9 ||
             std::ranges::any_of(p.balance, [](double b) { return b != 1; });
  }
  for (std::size_t i = 0; i < all.size(); ++i) result.calibration.heads[i].response = response_of(all[i], needed);
}

}  // namespace nodal::interchange
