#include "opencv_peer.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace nodal::bench {
namespace {

/// A run of columns in a band where a head looks.
struct Piece {
  HeadIndex head = 0;
  bool alone = false;
  cv::Rect area;
  cv::Mat map1, map2;  ///< as cv::convertMaps makes them for CV_16SC2
  cv::Mat weight;      ///< 8 bits
};

struct Band {
  std::vector<Piece> pieces;
};

/// A band's samples: for each head where each pixel lies, and how much of it is taken, in 1/255.
struct Dense {
  cv::Mat x, y, weight;
};

/// Columns are told apart in units of this many.
constexpr int kUnit = 16;

Piece piece_of(const Dense& dense, HeadIndex head, int first, int last, int top, bool alone) {
  Piece piece{head, alone, cv::Rect(first, top, last - first, dense.x.rows), {}, {}, {}};
  const cv::Rect here(first, 0, last - first, dense.x.rows);
  cv::convertMaps(dense.x(here), dense.y(here), piece.map1, piece.map2, CV_16SC2);
  if (!alone) dense.weight(here).copyTo(piece.weight);
  return piece;
}

Band band_of(const table::RaySampler& sampler, int grid, int top, int rows, int width) {
  std::vector<Dense> dense(sampler.heads().size());
  for (Dense& head : dense) {
    head.x = cv::Mat::zeros(rows, width, CV_32F);
    head.y = cv::Mat::zeros(rows, width, CV_32F);
    head.weight = cv::Mat::zeros(rows, width, CV_8U);
  }
  std::vector<unsigned> looks((width + kUnit - 1) / kUnit, 0);
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
        dense[s.head].x.at<float>(y, x) = static_cast<float>(s.x);
        dense[s.head].y.at<float>(y, x) = static_cast<float>(s.y);
        dense[s.head].weight.at<unsigned char>(y, x) = static_cast<unsigned char>(weight);
        looks[x / kUnit] |= 1U << s.head;
      }
    }
  }
  Band band;
  const auto one = [](unsigned mask) { return mask != 0 && (mask & (mask - 1)) == 0; };
  for (std::size_t h = 0; h < dense.size(); ++h) {
    for (const bool alone : {true, false}) {
      for (std::size_t u = 0; u < looks.size();) {
        std::size_t end = u;
        while (end < looks.size() && (looks[end] >> h & 1) != 0 && one(looks[end]) == alone) ++end;
        if (end == u) {
          ++u;
          continue;
        }
        band.pieces.push_back(piece_of(dense[h], static_cast<HeadIndex>(h), static_cast<int>(u) * kUnit,
                                       std::min(width, static_cast<int>(end) * kUnit), top, alone));
        u = end;
      }
    }
  }
  return band;
}

cv::Mat mat_of(const PlaneView& plane) {
  return {plane.height, plane.width, CV_8U, const_cast<std::uint8_t*>(plane.data), static_cast<std::size_t>(plane.row_stride)};
}

}  // namespace

struct OpenCvPeer::State {
  std::vector<Band> bands[2];
  double bytes = 0;
};

OpenCvPeer::OpenCvPeer(const table::RaySampler& sampler) : state_(std::make_unique<State>()) {
  cv::setNumThreads(1);  // bands are its threads' work
  for (int g = 0; g < 2; ++g) {
    const table::RaySampler::Grid& grid = sampler.grids()[static_cast<std::size_t>(g)];
    const int rows = g == 0 ? kBandRows : kBandRows / 2;
    for (int top = 0; top < grid.height; top += rows) {
      state_->bands[g].push_back(band_of(sampler, g, top, std::min(rows, grid.height - top), grid.width));
      for (const Piece& piece : state_->bands[g].back().pieces) state_->bytes += piece.area.area() * (piece.alone ? 6. : 7.);
    }
  }
}
OpenCvPeer::~OpenCvPeer() = default;

int OpenCvPeer::bands() const { return static_cast<int>(state_->bands[0].size()); }
double OpenCvPeer::table_bytes() const { return state_->bytes; }

void OpenCvPeer::band(std::span<const ImageView> heads, const MutableImageView& raymap, int number) const {
  thread_local std::vector<std::uint16_t> sums;
  thread_local cv::Mat warped;
  for (std::size_t c = 0; c < 3; ++c) {
    const Band& band = state_->bands[c > 0][static_cast<std::size_t>(number)];
    const MutablePlaneView& out = raymap.planes[c];
    const int rows = c > 0 ? kBandRows / 2 : kBandRows;
    const int top = number * rows;
    const int bottom = std::min(out.height, top + rows);
    sums.assign(static_cast<std::size_t>((bottom - top) * out.width), 0);
    for (const Piece& piece : band.pieces) {
      if (piece.alone) continue;
      cv::remap(mat_of(heads[piece.head].planes[c]), warped, piece.map1, piece.map2, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      for (int y = 0; y < piece.area.height; ++y) {
        std::uint16_t* sum = &sums[static_cast<std::size_t>((piece.area.y - top + y) * out.width + piece.area.x)];
        const unsigned char* value = warped.ptr(y);
        const unsigned char* weight = piece.weight.ptr(y);
        for (int x = 0; x < piece.area.width; ++x) sum[x] += value[x] * weight[x];
      }
    }
    for (int y = top; y < bottom; ++y) {
      std::uint8_t* to = out.data + y * out.row_stride;
      const std::uint16_t* sum = &sums[static_cast<std::size_t>((y - top) * out.width)];
      for (int x = 0; x < out.width; ++x) to[x] = static_cast<std::uint8_t>(((sum[x] + 128) * 257U) >> 16);
    }
    cv::Mat whole(out.height, out.width, CV_8U, out.data, static_cast<std::size_t>(out.row_stride));
    for (const Piece& piece : band.pieces) {
      if (!piece.alone) continue;
      cv::Mat into = whole(piece.area);
      cv::remap(mat_of(heads[piece.head].planes[c]), into, piece.map1, piece.map2, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    }
  }
}

}  // namespace nodal::bench
