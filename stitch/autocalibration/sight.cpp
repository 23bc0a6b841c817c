#include "stitch/autocalibration/sight.h"

#include <utility>

#include "stitch/autocalibration/picture.h"

namespace nodal::autocalibration {
namespace {

constexpr int kFeatureSide = 1600;          // px; larger pictures are reduced to this to find features
constexpr int kRimSide = 3200;              // px; the same to find features in rims
constexpr std::size_t kFeatures = 2500;     // per picture
constexpr std::size_t kRimFeatures = 4000;  // per picture
// Share of the circle's radius; overlaps that reach farther inwards have enough features.
constexpr double kRimFrom = 0.8;

struct Effort {
  int side = kFeatureSide;
  std::size_t features = kFeatures;
  double from = 0;  // smallest distance from the centre, share of the circle's radius
};

std::vector<Feature> features_of(const DecodedImage& whole, const Shape& shape, const Effort& effort) {
  Picture picture = reduced(whole, effort.side);
  const double scale = static_cast<double>(whole.width) / picture.width;
  Region region{0, 0, whole.width / scale, whole.height / scale, {}};
  if (shape.circle) {
    const Region::Circle& circle = *shape.circle;
    region.circle = Region::Circle{circle.x / scale, circle.y / scale, circle.radius / scale};
  }
  region.masks = shape.masks;
  for (std::vector<Region::Point>& mask : region.masks) {
    for (Region::Point& corner : mask) corner = {corner.x / scale, corner.y / scale};
  }
  std::vector<Feature> features = effort.from > 0 ? find_rim_features(std::move(picture), region, effort.features,
                                                                      effort.from * region.circle->radius)
                                                  : find_features(picture, region, effort.features);
  for (Feature& feature : features) feature.pixel = {feature.pixel.x * scale, feature.pixel.y * scale};
  return features;
}

Sight seen(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes, const Effort& effort,
           const parallel::Workers& workers) {
  Sight sight;
  sight.features.resize(pictures.size());
  workers.run(static_cast<int>(pictures.size()), [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    sight.features[n] = features_of(pictures[n], shapes[n], effort);
  });
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < pictures.size(); ++a) {
    for (std::size_t b = a + 1; b < pictures.size(); ++b) pairs.emplace_back(a, b);
  }
  std::vector<std::vector<Match>> of_pair(pairs.size());
  std::vector<Repetition> repetitions(pairs.size());
  workers.run(static_cast<int>(pairs.size()), [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    const auto [a, b] = pairs[n];
    of_pair[n] = find_matches(a, sight.features[a], b, sight.features[b], &repetitions[n]);
  });
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    sight.matches.insert(sight.matches.end(), of_pair[n].begin(), of_pair[n].end());
    sight.repetition.add(repetitions[n]);
  }
  return sight;
}

}  // namespace

Sight see(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes,
          const parallel::Workers& workers) {
  return seen(pictures, shapes, {}, workers);
}

Sight see_rims(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes,
               const parallel::Workers& workers) {
  return seen(pictures, shapes, {kRimSide, kRimFeatures, kRimFrom}, workers);
}

}  // namespace nodal::autocalibration
