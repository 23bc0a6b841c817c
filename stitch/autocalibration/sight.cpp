#include "stitch/autocalibration/sight.h"

#include <algorithm>
#include <utility>

#include "stitch/autocalibration/picture.h"
#include "stitch/parallel/part_of.h"

namespace nodal::autocalibration {
namespace {

constexpr int kFeatureSide = 1600;          // px; larger pictures are reduced to this to find features
constexpr int kRimSide = 3200;              // px; the same to find features in rims
constexpr std::size_t kFeatures = 2500;     // per picture
constexpr std::size_t kRimFeatures = 4000;  // per picture
// Share of the circle's radius; overlaps that reach farther inwards have enough features.
constexpr double kRimFrom = 0.8;

// Pictures that are compared with every other one; more of them are first compared by a few features, which takes a
// 25th of the time, and each then with those that are likely to show the same.
constexpr std::size_t kAllPairs = 10;
constexpr std::size_t kFirstFeatures = 500;
constexpr std::size_t kLikely = 6;      // pictures that are most alike, for each one
constexpr std::size_t kFirstSure = 12;  // matches of those features that are hardly by chance

constexpr double kFeaturesShare = 0.5;  // share of the time

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

using Pair = std::pair<std::size_t, std::size_t>;

std::vector<Pair> likely_pairs(const std::vector<std::vector<Feature>>& features, const parallel::Workers& workers) {
  std::vector<Pair> all;
  for (std::size_t a = 0; a < features.size(); ++a) {
    for (std::size_t b = a + 1; b < features.size(); ++b) all.emplace_back(a, b);
  }
  if (features.size() <= kAllPairs) return all;
  // The features are in an order in which the first ones are spread over the picture.
  std::vector<std::vector<Feature>> first;
  for (const std::vector<Feature>& of_one : features) {
    first.emplace_back(of_one.begin(),
                       of_one.begin() + static_cast<std::ptrdiff_t>(std::min(of_one.size(), kFirstFeatures)));
  }
  std::vector<std::size_t> alike(all.size());
  workers.run(static_cast<int>(all.size()), [&](int i) {
    const auto [a, b] = all[static_cast<std::size_t>(i)];
    alike[static_cast<std::size_t>(i)] = find_matches(a, first[a], b, first[b]).size();
  });
  // By picture: the numbers of its pairs, the most alike first.
  std::vector<std::vector<std::size_t>> of_picture(features.size());
  for (std::size_t n = 0; n < all.size(); ++n) {
    of_picture[all[n].first].push_back(n);
    of_picture[all[n].second].push_back(n);
  }
  std::vector<bool> taken(all.size());
  for (std::vector<std::size_t>& pairs : of_picture) {
    std::ranges::stable_sort(pairs, [&](std::size_t p, std::size_t q) { return alike[p] > alike[q]; });
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (k < kLikely || alike[pairs[k]] >= kFirstSure) taken[pairs[k]] = true;
    }
  }
  std::vector<Pair> likely;
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (taken[n]) likely.push_back(all[n]);
  }
  return likely;
}

Sight seen(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes, const Effort& effort,
           const parallel::Workers& workers, const std::function<void(double)>& progress) {
  Sight sight;
  sight.features.resize(pictures.size());
  const auto find = [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    sight.features[n] = features_of(pictures[n], shapes[n], effort);
  };
  workers.run(static_cast<int>(pictures.size()), find, parallel::part_of(progress, 0, kFeaturesShare));
  const std::vector<Pair> pairs = likely_pairs(sight.features, workers);
  std::vector<std::vector<Match>> of_pair(pairs.size());
  std::vector<Repetition> repetitions(pairs.size());
  const auto match = [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    const auto [a, b] = pairs[n];
    of_pair[n] = find_matches(a, sight.features[a], b, sight.features[b], &repetitions[n]);
  };
  workers.run(static_cast<int>(pairs.size()), match, parallel::part_of(progress, kFeaturesShare, 1 - kFeaturesShare));
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    sight.matches.insert(sight.matches.end(), of_pair[n].begin(), of_pair[n].end());
    sight.repetition.add(repetitions[n]);
  }
  return sight;
}

}  // namespace

std::vector<Feature> features_of(const DecodedImage& picture, const Shape& shape) {
  return features_of(picture, shape, Effort{});
}

Sight see(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes, const parallel::Workers& workers,
          const std::function<void(double)>& progress) {
  return seen(pictures, shapes, {}, workers, progress);
}

Sight see_rims(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes,
               const parallel::Workers& workers, const std::function<void(double)>& progress) {
  return seen(pictures, shapes, {kRimSide, kRimFeatures, kRimFrom}, workers, progress);
}

}  // namespace nodal::autocalibration
