#include "stitch/bands/multi_band.h"

#include <algorithm>
#include <utility>

#include "stitch/bands/pyramid.h"

namespace nodal::bands {
namespace {

/// Weights below this count as 0: rounding is about 1e-7.
constexpr float kNothing = 1e-5F;

/// The mean colour of a layer whose colours are multiplied by `weight_channel`.
std::vector<float> mean_colour(const Layer& layer, int colours, int weight_channel) {
  std::vector<double> sums(static_cast<std::size_t>(colours) + 1);
  for (int j = 0; j < layer.window().height; ++j) {
    for (int i = 0; i < layer.window().width; ++i) {
      const float* pixel = layer.at(i, j);
      for (int c = 0; c < colours; ++c) sums[static_cast<std::size_t>(c)] += static_cast<double>(pixel[c]);
      sums.back() += static_cast<double>(pixel[weight_channel]);
    }
  }
  std::vector<float> mean;
  for (int c = 0; c < colours; ++c) {
    mean.push_back(sums.back() > 0 ? static_cast<float>(sums[static_cast<std::size_t>(c)] / sums.back()) : 0.0F);
  }
  return mean;
}

/// Divides the coarsest level's colours by their weight; pixels without weight get the mean.
void normalize(Layer& coarsest, int colours, int weight_channel) {
  const std::vector<float> mean = mean_colour(coarsest, colours, weight_channel);
  for (int j = 0; j < coarsest.window().height; ++j) {
    for (int i = 0; i < coarsest.window().width; ++i) {
      float* pixel = coarsest.at(i, j);
      const float weight = pixel[weight_channel];
      for (int c = 0; c < colours; ++c) {
        pixel[c] = weight > kNothing ? pixel[c] / weight : mean[static_cast<std::size_t>(c)];
      }
    }
  }
}

}  // namespace

MultiBand::MultiBand(Grid grid, const Window& window, int colours, int threads)
    : colours_(colours), workers_(threads), grids_(grids_below(grid)) {
  sums_.emplace_back(grid, window, colours + 1);
  for (std::size_t l = 1; l < grids_.size(); ++l) {
    sums_.emplace_back(grids_[l], reduced_window(grids_[l - 1], sums_.back().window(), grids_[l]), colours + 1);
  }
}

void MultiBand::add(Layer picture) {
  std::vector<Layer> levels;
  levels.push_back(std::move(picture));
  while (levels.size() < grids_.size()) levels.push_back(reduced(levels.back(), grids_[levels.size()], workers_));
  normalize(levels.back(), colours_, colours_);
  for (std::size_t l = levels.size(); l-- > 0;) {
    Layer& level = levels[l];
    const bool coarsest = l + 1 == levels.size();
    const Window &window = level.window(), &within = sums_[l].window();
    const int columns = level.grid().width;
    workers_.run(window.height, [&](int j) {
      std::vector<float> coarser(static_cast<std::size_t>(window.width * level.channels()), 0);
      if (!coarsest) Expansion(levels[l + 1], level.grid()).row(window.y + j, window.x, window.width, coarser);
      for (int i = 0; i < window.width; ++i) {
        float* pixel = level.at(i, j);
        const float* below = coarser.data() + static_cast<std::ptrdiff_t>(i) * level.channels();
        const float missing = coarsest ? 0 : 1 - pixel[colours_];
        const float weight = pixel[colours_ + 1];
        float* sum = sums_[l].at((window.x + i - within.x + columns) % columns, window.y + j - within.y);
        for (int c = 0; c < colours_; ++c) {
          pixel[c] += missing * below[c];
          sum[c] += weight * (pixel[c] - below[c]);
        }
        sum[colours_] += weight;
      }
    });
    if (!coarsest) levels.pop_back();
  }
}

Layer MultiBand::finish() {
  normalize(sums_.back(), colours_, colours_);
  for (std::size_t l = sums_.size() - 1; l-- > 0;) {
    Layer& level = sums_[l];
    const Window& window = level.window();
    workers_.run(window.height, [&](int j) {
      std::vector<float> coarser;
      Expansion(sums_[l + 1], level.grid()).row(window.y + j, window.x, window.width, coarser);
      for (int i = 0; i < window.width; ++i) {
        float* sum = level.at(i, j);
        const float weight = sum[colours_];
        for (int c = 0; c < colours_; ++c) {
          sum[c] =
              (weight > kNothing ? sum[c] / weight : 0) + coarser[static_cast<std::size_t>(i * (colours_ + 1) + c)];
        }
      }
    });
    sums_.pop_back();
  }
  return std::move(sums_.front());
}

}  // namespace nodal::bands
