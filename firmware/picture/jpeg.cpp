#include "firmware/picture/jpeg.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <utility>

#include "stitch/media/gpano.h"

namespace nodal::firmware {
namespace {

constexpr std::string_view kXmpName("http://ns.adobe.com/xap/1.0/\0", 29);
constexpr std::uint8_t kApp0 = 0xe0, kApp1 = 0xe1, kComment = 0xfe;

int subsampling(PixelFormat format) {
  switch (format) {
    case PixelFormat::kI420: return TJSAMP_420;
    case PixelFormat::kGrey8: return TJSAMP_GRAY;
    default: return TJSAMP_444;
  }
}

PixelFormat coded_as(PixelFormat raymap) {
  return raymap == PixelFormat::kNv12 ? PixelFormat::kI420 : in_8_bits(raymap);
}

/// A JPEG segment: marker, length of body plus 2 bytes for the length itself, body (ITU T.81, B.1.1.4).
void append_segment(std::vector<std::uint8_t>& to, std::uint8_t marker, std::initializer_list<std::string_view> body) {
  std::size_t length = 2;
  for (const std::string_view part : body) length += part.size();
  NODAL_ASSERT(length <= 0xffff);
  to.insert(to.end(), {0xff, marker, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)});
  for (const std::string_view part : body) to.insert(to.end(), part.begin(), part.end());
}

/// Length in bytes of SOI and of JFIF's APP0, if present; APP0 must be the first segment.
std::size_t lead_bytes(const std::uint8_t* jpeg, std::size_t size) {
  if (size < 6 || jpeg[2] != 0xff || jpeg[3] != kApp0) return 2;
  const std::size_t end = 4 + (static_cast<std::size_t>(jpeg[4]) << 8 | jpeg[5]);
  return end <= size ? end : 2;
}

}  // namespace

std::string gpano_packet(int width, int height) { return media::gpano_packet(width, height); }

void RaymapComment::add(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  const int more = std::vsnprintf(text_.data() + length_, text_.size() - length_, format, arguments);
  va_end(arguments);
  NODAL_ASSERT(more > 0 && static_cast<std::size_t>(more) < text_.size() - length_);
  length_ += static_cast<std::size_t>(more);
}

RaymapComment::RaymapComment(const RaymapInfo& info) {
  add("nodal set=%llu mid_exposure_ns=%lld spread_ns=%lld heads=0x%x genlock=%s calibration=",
      static_cast<unsigned long long>(info.set), static_cast<long long>(info.mid_exposure.ns()),
      static_cast<long long>(info.sync.spread.ns()), info.heads, genlock_state_name(info.sync.state).data());
  for (const std::uint8_t byte : info.calibration) add("%02x", byte);
  if (info.field) add(" field=%d parity=%s", info.field->number, field_parity_name(info.field->parity).data());
  if (info.sync.trigger) add(" trigger=%llu", static_cast<unsigned long long>(*info.sync.trigger));
}

JpegEncoder::JpegEncoder(const RaymapConfig& config)
    : config_(config),
      coded_(coded_as(config.format)),
      handle_(tjInitCompress()),
      scratch_bytes_(tjBufSize(config.width, config.height, subsampling(coded_))) {
  NODAL_ASSERT(handle_);
  if (coded_ != config.format) picture_.resize(packed_size(coded_, config.width, config.height));
  if (is_linear16(config.format)) level_of_.resize(65536);
  scratch_ = std::make_unique_for_overwrite<std::uint8_t[]>(scratch_bytes_);
  if (config.layout == RaymapLayout::kEquirectangular) {
    append_segment(gpano_, kApp1, {kXmpName, gpano_packet(config.width, config.height)});
  }
}

JpegEncoder::~JpegEncoder() { tjDestroy(handle_); }

void JpegEncoder::set_levels(const blend::LinearScale& scale) {
  if (scale.shown_from == shown_from_) return;  // the usual case: exposures did not change
  shown_from_ = scale.shown_from;
  std::size_t number = 0;
  for (std::size_t level = 0; level < 256; ++level) {
    const std::size_t end = level < 255 ? std::max<std::size_t>(number, shown_from_[level + 1]) : level_of_.size();
    std::fill(level_of_.begin() + static_cast<std::ptrdiff_t>(number),
              level_of_.begin() + static_cast<std::ptrdiff_t>(end), static_cast<std::uint8_t>(level));
    number = end;
  }
}

ImageView JpegEncoder::codable(const ImageView& raymap, const RaymapInfo& info) {
  if (coded_ == raymap.format) return raymap;
  if (info.linear) set_levels(*info.linear);
  const bool linear = is_linear16(raymap.format);
  const MutableImageView picture = packed_image(coded_, raymap.width, raymap.height, picture_.data());
  for (std::size_t c = linear ? 0 : 1; c < static_cast<std::size_t>(component_count(coded_)); ++c) {
    const PlaneView& from = raymap.planes[c];
    const MutablePlaneView& to = picture.planes[c];
    for (int y = 0; y < to.height; ++y) {
      const std::uint8_t* in = from.data + y * from.row_stride;
      std::uint8_t* out = to.data + y * to.row_stride;
      for (int x = 0; x < to.width; ++x, in += from.pixel_stride, out += to.pixel_stride) {
        *out = linear ? level_of_[static_cast<std::size_t>(in[0] | in[1] << 8)] : *in;
      }
    }
  }
  ImageView coded = packed_image(coded_, raymap.width, raymap.height, std::as_const(picture_).data());
  if (!linear) coded.planes[0] = raymap.planes[0];
  return coded;
}

Result<std::size_t> JpegEncoder::compress(const ImageView& raymap) {
  unsigned char* out = scratch_.get();
  unsigned long size = scratch_bytes_;
  constexpr int kFlags = TJFLAG_NOREALLOC;
  int failed = 0;
  if (coded_ == PixelFormat::kRgb24) {
    failed = tjCompress2(handle_, raymap.planes[0].data, raymap.width, static_cast<int>(raymap.planes[0].row_stride),
                         raymap.height, TJPF_RGB, &out, &size, TJSAMP_444, config_.jpeg_quality, kFlags);
  } else {
    std::array<const unsigned char*, kMaxPlanes> planes{};
    std::array<int, kMaxPlanes> strides{};
    for (std::size_t c = 0; c < planes.size(); ++c) {
      planes[c] = raymap.planes[c].data;
      strides[c] = static_cast<int>(raymap.planes[c].row_stride);
    }
    failed = tjCompressFromYUVPlanes(handle_, planes.data(), raymap.width, strides.data(), raymap.height,
                                     subsampling(coded_), &out, &size, config_.jpeg_quality, kFlags);
  }
  if (failed != 0) return fail(Errc::kInternal, std::string("JPEG encoder: ") + tjGetErrorStr2(handle_));
  return static_cast<std::size_t>(size);
}

Status JpegEncoder::encode(const ImageView& raymap, const RaymapInfo& info, std::vector<std::uint8_t>& into) {
  NODAL_ASSERT(raymap.format == config_.format && raymap.width == config_.width && raymap.height == config_.height);
  const auto size = compress(codable(raymap, info));
  if (!size) return fail(size.error());
  const std::uint8_t* jpeg = scratch_.get();
  const std::size_t lead = lead_bytes(jpeg, *size);
  into.assign(jpeg, jpeg + lead);
  into.insert(into.end(), gpano_.begin(), gpano_.end());
  append_segment(into, kComment, {RaymapComment(info).text()});
  into.insert(into.end(), jpeg + lead, jpeg + *size);
  return {};
}

}  // namespace nodal::firmware
