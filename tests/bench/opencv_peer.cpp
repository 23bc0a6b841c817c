#include "opencv_peer.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace nodal::bench {
namespace {

cv::Mat mat_of(const PlaneView& plane) {
  return {plane.height, plane.width, CV_8U, const_cast<std::uint8_t*>(plane.data),
          static_cast<std::size_t>(plane.row_stride)};
}
void remap(const PlaneView& from, const cv::Mat& map1, const cv::Mat& map2, cv::Mat& to) {
  cv::remap(mat_of(from), to, map1, map2, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
}

/// Calls take(x, y, sample, weight) for every head that sees a ray of a band; weights in 1/255.
template <class Take>
void each_sample(const table::RaySampler& sampler, int grid, int top, int rows, int width, Take take) {
  table::RowSampler row(sampler);
  for (int y = 0; y < rows; ++y) {
    row.sample(grid, top + y);
    for (int x = 0; x < width; ++x) {
      int left = 255;
      const auto samples = row.at(x);
      for (std::size_t k = 0; k < samples.size(); ++k) {
        const int weight = k + 1 == samples.size() ? left : std::min(left, cvRound(samples[k].weight * 255));
        left -= weight;
        if (weight != 0) take(x, y, samples[k], static_cast<std::uint8_t>(weight));
      }
    }
  }
}

/// Some rows of one grid of the raymap.
class Band {
 public:
  virtual ~Band() = default;
  virtual double bytes() const = 0;
  /// Adds the heads' contributions to `sums`, in 1/255, ray by ray.
  virtual void add(std::span<const ImageView> heads, std::size_t c, std::vector<std::uint16_t>& sums,
                   cv::Mat& warped) const = 0;
  /// Overwrites rays that one head sees alone with that head's samples.
  virtual void cover(std::span<const ImageView> heads, std::size_t c, const cv::Mat& plane) const = 0;
};

/// Ordered rays: runs of columns that a head sees.
class OrderedBand : public Band {
 public:
  OrderedBand(const table::RaySampler& sampler, int grid, int top, int rows, int width) : top_(top), width_(width) {
    std::vector<Dense> dense(sampler.heads().size());
    for (Dense& head : dense) {
      head.x = cv::Mat::zeros(rows, width, CV_32F);
      head.y = cv::Mat::zeros(rows, width, CV_32F);
      head.weight = cv::Mat::zeros(rows, width, CV_8U);
    }
    std::vector<unsigned> looks((width + kUnit - 1) / kUnit, 0);
    each_sample(sampler, grid, top, rows, width, [&](int x, int y, const table::RaySample& s, std::uint8_t weight) {
      dense[s.head].x.at<float>(y, x) = static_cast<float>(s.x);
      dense[s.head].y.at<float>(y, x) = static_cast<float>(s.y);
      dense[s.head].weight.at<unsigned char>(y, x) = weight;
      looks[x / kUnit] |= 1U << s.head;
    });
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
          add_piece(dense[h], static_cast<HeadIndex>(h), static_cast<int>(u) * kUnit,
                    std::min(width, static_cast<int>(end) * kUnit), alone);
          u = end;
        }
      }
    }
  }

  double bytes() const override {
    double bytes = 0;
    for (const Piece& piece : pieces_) bytes += piece.area.area() * (piece.alone ? 6. : 7.);
    return bytes;
  }
  void add(std::span<const ImageView> heads, std::size_t c, std::vector<std::uint16_t>& sums,
           cv::Mat& warped) const override {
    for (const Piece& piece : pieces_) {
      if (piece.alone) continue;
      remap(heads[piece.head].planes[c], piece.map1, piece.map2, warped);
      for (int y = 0; y < piece.area.height; ++y) {
        std::uint16_t* sum = &sums[static_cast<std::size_t>((piece.area.y - top_ + y) * width_ + piece.area.x)];
        const unsigned char* value = warped.ptr(y);
        const unsigned char* weight = piece.weight.ptr(y);
        for (int x = 0; x < piece.area.width; ++x) sum[x] += value[x] * weight[x];
      }
    }
  }
  void cover(std::span<const ImageView> heads, std::size_t c, const cv::Mat& plane) const override {
    for (const Piece& piece : pieces_) {
      if (!piece.alone) continue;
      cv::Mat into = plane(piece.area);
      remap(heads[piece.head].planes[c], piece.map1, piece.map2, into);
    }
  }

 private:
  static constexpr int kUnit = 16;  ///< runs are in units of this many columns

  /// For one head, the position and the weight in 1/255 of every pixel.
  struct Dense {
    cv::Mat x, y, weight;
  };
  struct Piece {
    HeadIndex head = 0;
    bool alone = false;
    cv::Rect area;
    cv::Mat map1, map2;  ///< maps that cv::convertMaps makes with CV_16SC2
    cv::Mat weight;      ///< 8 bits
  };

  void add_piece(const Dense& dense, HeadIndex head, int first, int last, bool alone) {
    Piece piece{head, alone, cv::Rect(first, top_, last - first, dense.x.rows), {}, {}, {}};
    const cv::Rect here(first, 0, last - first, dense.x.rows);
    cv::convertMaps(dense.x(here), dense.y(here), piece.map1, piece.map2, CV_16SC2);
    if (!alone) dense.weight(here).copyTo(piece.weight);
    pieces_.push_back(piece);
  }

  int top_, width_;
  std::vector<Piece> pieces_;
};

/// Unordered rays: a list per head.
class ListedBand : public Band {
 public:
  ListedBand(const table::RaySampler& sampler, int grid, int top, int rows, int width)
      : heads_(sampler.heads().size()) {
    std::vector<std::vector<float>> xs(heads_.size()), ys(heads_.size());
    each_sample(sampler, grid, top, rows, width, [&](int x, int y, const table::RaySample& s, std::uint8_t weight) {
      xs[s.head].push_back(static_cast<float>(s.x));
      ys[s.head].push_back(static_cast<float>(s.y));
      heads_[s.head].index.push_back(static_cast<std::uint32_t>(y * width + x));
      heads_[s.head].weight.push_back(weight);
    });
    for (std::size_t h = 0; h < heads_.size(); ++h) heads_[h].map(xs[h], ys[h]);
  }

  double bytes() const override {
    double bytes = 0;
    for (const Seen& seen : heads_) bytes += static_cast<double>(seen.index.size()) * 11;
    return bytes;
  }
  void add(std::span<const ImageView> heads, std::size_t c, std::vector<std::uint16_t>& sums,
           cv::Mat& warped) const override {
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      const Seen& seen = heads_[h];
      if (seen.index.empty()) continue;
      remap(heads[h].planes[c], seen.map1, seen.map2, warped);
      const unsigned char* value = warped.ptr();
      for (std::size_t k = 0; k < seen.index.size(); ++k) {
        sums[seen.index[k]] = static_cast<std::uint16_t>(sums[seen.index[k]] + value[k] * seen.weight[k]);
      }
    }
  }
  void cover(std::span<const ImageView>, std::size_t, const cv::Mat&) const override {}

 private:
  /// The rays of the band that one head sees, in rows of kColumns for cv::remap.
  struct Seen {
    static constexpr int kColumns = 512;
    cv::Mat map1, map2;                ///< maps that cv::convertMaps makes with CV_16SC2
    std::vector<std::uint32_t> index;  ///< index of the ray in the band
    std::vector<std::uint8_t> weight;  ///< weight in 1/255

    void map(const std::vector<float>& x, const std::vector<float>& y) {
      if (x.empty()) return;
      const int rows = (static_cast<int>(x.size()) + kColumns - 1) / kColumns;
      cv::Mat xs = cv::Mat::zeros(rows, kColumns, CV_32F), ys = cv::Mat::zeros(rows, kColumns, CV_32F);
      std::copy(x.begin(), x.end(), xs.ptr<float>());
      std::copy(y.begin(), y.end(), ys.ptr<float>());
      cv::convertMaps(xs, ys, map1, map2, CV_16SC2);
    }
  };
  std::vector<Seen> heads_;
};

}  // namespace

struct OpenCvPeer::State {
  std::vector<std::unique_ptr<Band>> bands[2];
};

OpenCvPeer::OpenCvPeer(const table::RaySampler& sampler, RaysAre rays) : state_(std::make_unique<State>()) {
  cv::setNumThreads(1);  // the bench's own threads process the bands
  for (int g = 0; g < 2; ++g) {
    const table::RaySampler::Grid& grid = sampler.grids()[static_cast<std::size_t>(g)];
    const int rows = g == 0 ? kBandRows : kBandRows / 2;
    for (int top = 0; top < grid.height; top += rows) {
      const int here = std::min(rows, grid.height - top);
      if (rays == RaysAre::kInOrder) {
        state_->bands[g].push_back(std::make_unique<OrderedBand>(sampler, g, top, here, grid.width));
      } else {
        state_->bands[g].push_back(std::make_unique<ListedBand>(sampler, g, top, here, grid.width));
      }
    }
  }
}
OpenCvPeer::~OpenCvPeer() = default;

int OpenCvPeer::bands() const { return static_cast<int>(state_->bands[0].size()); }
double OpenCvPeer::table_bytes() const {
  double bytes = 0;
  for (const auto& bands : state_->bands) {
    for (const auto& band : bands) bytes += band->bytes();
  }
  return bytes;
}

void OpenCvPeer::band(std::span<const ImageView> heads, const MutableImageView& raymap, int number) const {
  thread_local std::vector<std::uint16_t> sums;
  thread_local cv::Mat warped;
  for (std::size_t c = 0; c < 3; ++c) {
    const Band& band = *state_->bands[c > 0][static_cast<std::size_t>(number)];
    const MutablePlaneView& out = raymap.planes[c];
    const int rows = c > 0 ? kBandRows / 2 : kBandRows;
    const int top = number * rows;
    const int bottom = std::min(out.height, top + rows);
    sums.assign(static_cast<std::size_t>((bottom - top) * out.width), 0);
    band.add(heads, c, sums, warped);
    for (int y = top; y < bottom; ++y) {
      std::uint8_t* to = out.data + y * out.row_stride;
      const std::uint16_t* sum = &sums[static_cast<std::size_t>((y - top) * out.width)];
      for (int x = 0; x < out.width; ++x) to[x] = static_cast<std::uint8_t>(((sum[x] + 128) * 257U) >> 16);
    }
    band.cover(heads, c, cv::Mat(out.height, out.width, CV_8U, out.data, static_cast<std::size_t>(out.row_stride)));
  }
}

}  // namespace nodal::bench
