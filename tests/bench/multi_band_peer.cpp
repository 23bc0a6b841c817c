#include "multi_band_peer.h"

#include <algorithm>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/stitching/detail/blenders.hpp>
#include <vector>

namespace nodal::bench {
namespace {

constexpr int kBands = 5;  // OpenCV's default

struct Warp {
  cv::Rect box;  ///< place in the raymap
  cv::Mat map1, map2;
  cv::Mat mask;  ///< where the head is the best one
};

/// An I420 picture without padding, as OpenCV has it.
cv::Mat i420_of(const ImageView& picture) {
  return {picture.height * 3 / 2, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.planes[0].data)};
}

}  // namespace

struct MultiBandPeer::State {
  int width = 0;
  int height = 0;
  std::vector<Warp> warps;
};

MultiBandPeer::MultiBandPeer(const table::RaySampler& sampler) : state_(std::make_unique<State>()) {
  const auto& grid = sampler.grids()[0];
  state_->width = grid.width;
  state_->height = grid.height;
  const std::size_t heads = sampler.heads().size();
  std::vector<cv::Mat> x(heads), y(heads), mask(heads), seen(heads);
  for (std::size_t h = 0; h < heads; ++h) {
    x[h] = cv::Mat(grid.height, grid.width, CV_32F, cv::Scalar(-1));
    y[h] = x[h].clone();
    mask[h] = cv::Mat::zeros(grid.height, grid.width, CV_8U);
    seen[h] = mask[h].clone();
  }
  table::RowSampler row(sampler);
  for (int j = 0; j < grid.height; ++j) {
    row.sample(0, j);
    for (int i = 0; i < grid.width; ++i) {
      const table::RaySample* best = nullptr;
      for (const table::RaySample& sample : row.at(i)) {
        x[sample.head].at<float>(j, i) = static_cast<float>(sample.x);
        y[sample.head].at<float>(j, i) = static_cast<float>(sample.y);
        seen[sample.head].at<unsigned char>(j, i) = 255;
        if (best == nullptr || sample.weight > best->weight) best = &sample;
      }
      if (best != nullptr) mask[best->head].at<unsigned char>(j, i) = 255;
    }
  }
  for (std::size_t h = 0; h < heads; ++h) {
    Warp& warp = state_->warps.emplace_back();
    warp.box = cv::boundingRect(seen[h]);
    cv::convertMaps(x[h](warp.box), y[h](warp.box), warp.map1, warp.map2, CV_16SC2);
    warp.mask = mask[h](warp.box).clone();
  }
}

MultiBandPeer::~MultiBandPeer() = default;

void MultiBandPeer::blend(std::span<const ImageView> heads, const MutableImageView& raymap) {
  cv::detail::MultiBandBlender blender(false, kBands);
  blender.prepare(cv::Rect(0, 0, state_->width, state_->height));
  cv::Mat colours, warped, wide;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Warp& warp = state_->warps[h];
    cv::cvtColor(i420_of(heads[h]), colours, cv::COLOR_YUV2BGR_I420);
    cv::remap(colours, warped, warp.map1, warp.map2, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    warped.convertTo(wide, CV_16S);
    blender.feed(wide, warp.mask, warp.box.tl());
  }
  cv::Mat blended, mask, levels, i420;
  blender.blend(blended, mask);
  blended.convertTo(levels, CV_8U);
  cv::cvtColor(levels, i420, cv::COLOR_BGR2YUV_I420);
  std::memcpy(raymap.planes[0].data, i420.data, std::min(raymap.bytes, i420.total()));
}

double MultiBandPeer::table_bytes() const {
  double bytes = 0;
  for (const Warp& warp : state_->warps)
    bytes += static_cast<double>(warp.map1.total()) * 6 + static_cast<double>(warp.mask.total());
  return bytes;
}

}  // namespace nodal::bench
