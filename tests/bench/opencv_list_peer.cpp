#include "opencv_list_peer.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace nodal::bench {
namespace {

/// What one head sees of a band's rays, in rows of kColumns for cv::remap.
struct Seen {
  cv::Mat map1, map2;                ///< as cv::convertMaps makes them for CV_16SC2
  std::vector<std::uint32_t> index;  ///< of the ray in the band
  std::vector<std::uint8_t> weight;  ///< in 1/255
};
constexpr int kColumns = 512;

struct Band {
  std::vector<Seen> heads;
};

Seen seen_of(const std::vector<float>& x, const std::vector<float>& y, std::vector<std::uint32_t> index,
             std::vector<std::uint8_t> weight) {
  Seen seen{{}, {}, std::move(index), std::move(weight)};
  if (x.empty()) return seen;
  const int rows = (static_cast<int>(x.size()) + kColumns - 1) / kColumns;
  cv::Mat xs = cv::Mat::zeros(rows, kColumns, CV_32F), ys = cv::Mat::zeros(rows, kColumns, CV_32F);
  std::copy(x.begin(), x.end(), xs.ptr<float>());
  std::copy(y.begin(), y.end(), ys.ptr<float>());
  cv::convertMaps(xs, ys, seen.map1, seen.map2, CV_16SC2);
  return seen;
}

Band band_of(const table::RaySampler& sampler, int grid, int top, int rows, int width) {
  const std::size_t heads = sampler.heads().size();
  std::vector<std::vector<float>> xs(heads), ys(heads);
  std::vector<std::vector<std::uint32_t>> index(heads);
  std::vector<std::vector<std::uint8_t>> weights(heads);
  table::RowSampler row(sampler);
  for (int y = 0; y < rows; ++y) {
    row.sample(grid, top + y);
    for (int x = 0; x < width; ++x) {
      int left = 255;
      const auto samples = row.at(x);
      for (std::size_t k = 0; k < samples.size(); ++k) {
        const table::RaySample& s = samples[k];
        const int weight = k + 1 == samples.size() ? left : std::min(left, cvRound(s.weight * 255));
        left -= weight;
        if (weight == 0) continue;
        xs[s.head].push_back(static_cast<float>(s.x));
        ys[s.head].push_back(static_cast<float>(s.y));
        index[s.head].push_back(static_cast<std::uint32_t>(y * width + x));
        weights[s.head].push_back(static_cast<std::uint8_t>(weight));
      }
    }
  }
  Band band;
  for (std::size_t h = 0; h < heads; ++h) {
    band.heads.push_back(seen_of(xs[h], ys[h], std::move(index[h]), std::move(weights[h])));
  }
  return band;
}

cv::Mat mat_of(const PlaneView& plane) {
  return {plane.height, plane.width, CV_8U, const_cast<std::uint8_t*>(plane.data), static_cast<std::size_t>(plane.row_stride)};
}

}  // namespace

struct OpenCvListPeer::State {
  std::vector<Band> bands[2];
  double bytes = 0;
};

OpenCvListPeer::OpenCvListPeer(const table::RaySampler& sampler) : state_(std::make_unique<State>()) {
  cv::setNumThreads(1);  // bands are its threads' work
  for (int g = 0; g < 2; ++g) {
    const table::RaySampler::Grid& grid = sampler.grids()[static_cast<std::size_t>(g)];
    const int rows = g == 0 ? kBandRows : kBandRows / 2;
    for (int top = 0; top < grid.height; top += rows) {
      state_->bands[g].push_back(band_of(sampler, g, top, std::min(rows, grid.height - top), grid.width));
      for (const Seen& seen : state_->bands[g].back().heads) state_->bytes += static_cast<double>(seen.index.size()) * 11;
    }
  }
}
OpenCvListPeer::~OpenCvListPeer() = default;

int OpenCvListPeer::bands() const { return static_cast<int>(state_->bands[0].size()); }
double OpenCvListPeer::table_bytes() const { return state_->bytes; }

void OpenCvListPeer::band(std::span<const ImageView> heads, const MutableImageView& raymap, int number) const {
  thread_local std::vector<std::uint16_t> sums;
  thread_local cv::Mat warped;
  for (std::size_t c = 0; c < 3; ++c) {
    const Band& band = state_->bands[c > 0][static_cast<std::size_t>(number)];
    const MutablePlaneView& out = raymap.planes[c];
    const int rows = c > 0 ? kBandRows / 2 : kBandRows;
    const int top = number * rows;
    const int bottom = std::min(out.height, top + rows);
    sums.assign(static_cast<std::size_t>((bottom - top) * out.width), 0);
    for (std::size_t h = 0; h < band.heads.size(); ++h) {
      const Seen& seen = band.heads[h];
      if (seen.index.empty()) continue;
      cv::remap(mat_of(heads[h].planes[c]), warped, seen.map1, seen.map2, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      const unsigned char* value = warped.ptr();
      for (std::size_t k = 0; k < seen.index.size(); ++k) {
        sums[seen.index[k]] = static_cast<std::uint16_t>(sums[seen.index[k]] + value[k] * seen.weight[k]);
      }
    }
    for (int y = top; y < bottom; ++y) {
      std::uint8_t* to = out.data + y * out.row_stride;
      const std::uint16_t* sum = &sums[static_cast<std::size_t>((y - top) * out.width)];
      for (int x = 0; x < out.width; ++x) to[x] = static_cast<std::uint8_t>(((sum[x] + 128) * 257U) >> 16);
    }
  }
}

}  // namespace nodal::bench
