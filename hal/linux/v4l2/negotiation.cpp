#include "hal/linux/v4l2/negotiation.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <vector>

#include "hal/linux/v4l2/driver_text.h"
#include "protocol/base/try.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr std::uint32_t kMaxListed = 64;  ///< inputs, formats, sizes: for drivers whose list does not end

struct Standard {
  std::string_view name;
  v4l2_std_id id;
};
constexpr std::array<Standard, 9> kStandards{{{"NTSC", V4L2_STD_NTSC},
                                              {"NTSC-M", V4L2_STD_NTSC_M},
                                              {"NTSC-M-JP", V4L2_STD_NTSC_M_JP},
                                              {"PAL", V4L2_STD_PAL},
                                              {"PAL-M", V4L2_STD_PAL_M},
                                              {"PAL-N", V4L2_STD_PAL_N},
                                              {"PAL-Nc", V4L2_STD_PAL_Nc},
                                              {"PAL-60", V4L2_STD_PAL_60},
                                              {"SECAM", V4L2_STD_SECAM}}};

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "nothing" : text;
}

Error unsupported(const Device& device, const std::string& sentence) {
  return {Errc::kUnsupported, "head '" + device.head() + "': " + sentence};
}

Result<std::uint32_t> choose_input(const Device& device, const std::string& wanted) {
  if (wanted.empty()) {
    int current = 0;
    (void)device.ioctl(VIDIOC_G_INPUT, &current);  // devices with one input need not support the call
    return static_cast<std::uint32_t>(std::max(current, 0));
  }
  std::vector<std::string> names;
  for (std::uint32_t i = 0; i < kMaxListed; ++i) {
    v4l2_input input{};
    input.index = i;
    if (device.ioctl(VIDIOC_ENUMINPUT, &input) != 0) break;
    names.push_back(fmt::format("{} \"{}\"", i, text_of(input.name)));
    if (text_of(input.name) != wanted && std::to_string(i) != wanted) continue;
    int chosen = static_cast<int>(i);
    if (const int error = device.ioctl(VIDIOC_S_INPUT, &chosen); error != 0) {
      return fail(device.explained("choosing input " + wanted, error));
    }
    return i;
  }
  return fail(unsupported(device, "has no input '" + wanted + "'; it has " + joined(names)));
}

/// Returns 0 if the input has no standards.
Result<v4l2_std_id> choose_standard(const Device& device, const std::string& wanted) {
  v4l2_std_id id = 0;
  if (!wanted.empty()) {
    const auto* const known = std::find_if(kStandards.begin(), kStandards.end(),
                                           [&](const Standard& standard) { return standard.name == wanted; });
    if (known == kStandards.end()) {
      std::vector<std::string> names;
      names.reserve(kStandards.size());
      for (const Standard& standard : kStandards) names.emplace_back(standard.name);
      return fail(unsupported(device, "there is no standard '" + wanted + "'; choose one of " + joined(names)));
    }
    id = known->id;
    if (const int error = device.ioctl(VIDIOC_S_STD, &id); error != 0) {
      if (error == EINVAL || error == ENODATA || error == ENOTTY) {
        return fail(
            unsupported(device, "its input cannot be set to " + wanted + "; leave standard out, or choose another"));
      }
      return fail(device.explained("setting the standard to " + wanted, error));
    }
  }
  if (device.ioctl(VIDIOC_G_STD, &id) != 0) id = 0;
  return id;
}

Result<FourCc> choose_format(const Device& device, PixelFormat pixels) {
  std::vector<std::uint32_t> offered;
  std::vector<std::string> names;
  for (std::uint32_t i = 0; i < kMaxListed; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = device.buffer_type();
    if (device.ioctl(VIDIOC_ENUM_FMT, &description) != 0) break;
    offered.push_back(description.pixelformat);
    names.push_back(fourcc_text(description.pixelformat));
  }
  for (const FourCc& candidate : fourccs_of(pixels)) {
    if (candidate.memory_planes > 1 && !device.multiplanar()) continue;
    if (std::find(offered.begin(), offered.end(), candidate.code) != offered.end()) return candidate;
  }
  return fail(unsupported(
      device, "does not deliver " + std::string(pixel_format_name(pixels)) + "; it delivers " + joined(names) +
                  " (YU12 is I420, 422P is I422, RGB3 is RGB24, MJPG and JPEG are MJPEG, RGGB, GRBG, GBRG "
                  "and BA81 are RGGB8, GRBG8, GBRG8 and BGGR8); change format in rig.toml"));
}

std::string sizes_of(const Device& device, std::uint32_t code) {
  std::vector<std::string> sizes;
  for (std::uint32_t i = 0; i < kMaxListed; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = code;
    if (device.ioctl(VIDIOC_ENUM_FRAMESIZES, &size) != 0) break;
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      sizes.push_back(fmt::format("{}x{}", size.discrete.width, size.discrete.height));
      continue;
    }
    sizes.push_back(fmt::format("{}x{} to {}x{}", size.stepwise.min_width, size.stepwise.min_height,
                                size.stepwise.max_width, size.stepwise.max_height));
    break;
  }
  return sizes.empty() ? "" : "; it has " + joined(sizes);
}

/// The members common to both forms of v4l2_format.
struct Shape {
  std::uint32_t width, height, code, field;
  std::uint32_t colorspace, encoding, quantization;
  std::uint32_t memory_planes;
  std::array<std::uint32_t, kMaxPlanes> strides{};
  std::array<std::uint32_t, kMaxPlanes> sizes{};
};

void write_shape(const Device& device, const Shape& shape, v4l2_format& format) {
  if (device.multiplanar()) {
    v4l2_pix_format_mplane& mp = format.fmt.pix_mp;
    mp.width = shape.width;
    mp.height = shape.height;
    mp.pixelformat = shape.code;
    mp.field = shape.field;
    mp.num_planes = static_cast<std::uint8_t>(shape.memory_planes);
    for (v4l2_plane_pix_format& plane : mp.plane_fmt) plane.bytesperline = plane.sizeimage = 0;
    mp.flags = V4L2_PIX_FMT_FLAG_SET_CSC;
    mp.quantization = V4L2_QUANTIZATION_FULL_RANGE;
    mp.ycbcr_enc = V4L2_YCBCR_ENC_601;
    return;
  }
  v4l2_pix_format& pix = format.fmt.pix;
  pix.width = shape.width;
  pix.height = shape.height;
  pix.pixelformat = shape.code;
  pix.field = shape.field;
  pix.bytesperline = pix.sizeimage = 0;
  pix.priv = V4L2_PIX_FMT_PRIV_MAGIC;
  pix.flags = V4L2_PIX_FMT_FLAG_SET_CSC;
  pix.quantization = V4L2_QUANTIZATION_FULL_RANGE;
  pix.ycbcr_enc = V4L2_YCBCR_ENC_601;
}

Shape read_shape(const Device& device, const v4l2_format& format) {
  if (device.multiplanar()) {
    const v4l2_pix_format_mplane& mp = format.fmt.pix_mp;
    Shape shape{mp.width,     mp.height,       mp.pixelformat, mp.field, mp.colorspace,
                mp.ycbcr_enc, mp.quantization, mp.num_planes,  {},       {}};
    for (std::size_t p = 0; p < kMaxPlanes && p < mp.num_planes; ++p) {
      shape.strides[p] = mp.plane_fmt[p].bytesperline;
      shape.sizes[p] = mp.plane_fmt[p].sizeimage;
    }
    return shape;
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  return {pix.width,
          pix.height,
          pix.pixelformat,
          pix.field,
          pix.colorspace,
          pix.ycbcr_enc,
          pix.quantization,
          1,
          {pix.bytesperline, 0, 0},
          {pix.sizeimage, 0, 0}};
}

/// What the driver says about its Y U V; where it says "default", V4L2 defines what that is. JPEGs are full range
/// BT.601 by their own definition (JFIF 1.02), whatever a driver says.
Result<ColourCoding> coding_of(const Device& device, const Shape& shape, PixelFormat pixels) {
  if (!has_chroma(pixels)) return ColourCoding{};
  const std::uint32_t encoding = shape.encoding == V4L2_YCBCR_ENC_DEFAULT
                                     ? static_cast<std::uint32_t>(V4L2_MAP_YCBCR_ENC_DEFAULT(shape.colorspace))
                                     : shape.encoding;
  const std::uint32_t range =
      shape.quantization == V4L2_QUANTIZATION_DEFAULT
          ? static_cast<std::uint32_t>(V4L2_MAP_QUANTIZATION_DEFAULT(false, shape.colorspace, encoding))
          : shape.quantization;
  const bool video = range == V4L2_QUANTIZATION_LIM_RANGE;
  switch (encoding) {
    case V4L2_YCBCR_ENC_601:
    case V4L2_YCBCR_ENC_XV601: return ColourCoding{video, false};
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709: return ColourCoding{video, true};
    default:
      return fail(unsupported(device, fmt::format("codes its colours by neither BT.601 nor BT.709 (V4L2's number for "
                                                  "its coding is {}); choose another format or input in rig.toml",
                                                  encoding)));
  }
}

/// Equal to within a thousandth.
bool same_rate(const v4l2_fract& period, const FrameRate& rate) {
  const auto ours = static_cast<double>(rate.denominator) / rate.numerator;
  return period.denominator != 0 &&
         std::abs(static_cast<double>(period.numerator) / period.denominator / ours - 1) < 1e-3;
}

std::string rate_text(std::uint32_t numerator, std::uint32_t denominator) {
  return fmt::format("{}/{}", numerator, denominator);
}

Status set_rate(const Device& device, const FrameRate& rate, v4l2_std_id standard) {
  v4l2_fract period{rate.denominator, rate.numerator};
  bool known = false;
  v4l2_streamparm parameters{};
  parameters.type = device.buffer_type();
  parameters.parm.capture.timeperframe = period;
  if (device.ioctl(VIDIOC_S_PARM, &parameters) == 0 &&
      (parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    period = parameters.parm.capture.timeperframe;
    known = true;
  }
  for (std::uint32_t i = 0; !known && standard != 0 && i < kMaxListed; ++i) {
    v4l2_standard each{};
    each.index = i;
    if (device.ioctl(VIDIOC_ENUMSTD, &each) != 0) break;
    if ((each.id & standard) == 0) continue;
    period = each.frameperiod;
    known = true;
  }
  // If the driver does not report its rate, it is assumed to be the requested one; capture measures the real one.
  if (!known || same_rate(period, rate)) return {};
  return fail(unsupported(device, "delivers " + rate_text(period.denominator, period.numerator) +
                                      " frames a second, but the rig's rate is " +
                                      rate_text(rate.numerator, rate.denominator) +
                                      "; change rate, size or standard in rig.toml"));
}

}  // namespace

std::optional<Fields> fields_of(std::uint32_t field, Fields interlaced) {
  switch (field) {
    case V4L2_FIELD_ANY:  // the driver does not report it, as some for progressive sensors
    case V4L2_FIELD_NONE: return Fields::kProgressive;
    case V4L2_FIELD_INTERLACED:
    case V4L2_FIELD_ALTERNATE: return interlaced;
    case V4L2_FIELD_INTERLACED_TB:
    case V4L2_FIELD_SEQ_TB: return Fields::kTopFirst;
    case V4L2_FIELD_INTERLACED_BT:
    case V4L2_FIELD_SEQ_BT: return Fields::kBottomFirst;
    case V4L2_FIELD_TOP: return Fields::kTopOnly;
    case V4L2_FIELD_BOTTOM: return Fields::kBottomOnly;
    default: return std::nullopt;
  }
}

Result<Granted> negotiate(const Device& device, const HeadRequest& request) {
  Granted granted;
  NODAL_TRY_ASSIGN(const auto input, choose_input(device, request.input));
  granted.input = input;
  NODAL_TRY_ASSIGN(const auto standard, choose_standard(device, request.standard));
  // V4L2_FIELD_INTERLACED, by definition: M/NTSC transmits the bottom field first, all others the top field.
  granted.interlaced = (standard & V4L2_STD_525_60) != 0 ? Fields::kBottomFirst : Fields::kTopFirst;
  NODAL_TRY_ASSIGN(const auto code, choose_format(device, request.pixels));

  v4l2_format format{};
  format.type = device.buffer_type();
  if (const int error = device.ioctl(VIDIOC_G_FMT, &format); error != 0) {
    return fail(device.explained("reading its format", error));
  }
  Shape wanted = read_shape(device, format);
  if (wanted.field == V4L2_FIELD_ALTERNATE) wanted.height *= 2;  // V4L2's height is then that of a field
  if (request.width > 0) {
    wanted.width = static_cast<std::uint32_t>(request.width);
    wanted.height = static_cast<std::uint32_t>(request.height);
  }
  wanted.code = code.code;
  wanted.memory_planes = static_cast<std::uint32_t>(code.memory_planes);
  const bool interlaced = request.fields != Fields::kProgressive;
  const bool separate = interlaced && request.separate_fields;
  wanted.field = !interlaced ? V4L2_FIELD_NONE : separate ? V4L2_FIELD_ALTERNATE : V4L2_FIELD_INTERLACED;
  Shape asked = wanted;
  if (separate) asked.height /= 2;
  write_shape(device, asked, format);
  if (const int error = device.ioctl(VIDIOC_S_FMT, &format); error != 0) {
    return fail(device.explained("setting its format", error));
  }
  Shape got = read_shape(device, format);
  const int buffer_height = static_cast<int>(got.height);
  if (got.field == V4L2_FIELD_ALTERNATE) {
    granted.storage = FieldStorage::kAlternate;
    got.height *= 2;
  } else if (got.field == V4L2_FIELD_SEQ_TB || got.field == V4L2_FIELD_SEQ_BT) {
    granted.storage = FieldStorage::kSequential;
  }
  if (got.code != wanted.code || got.memory_planes != wanted.memory_planes) {
    return fail(unsupported(device, "says that it delivers " + fourcc_text(wanted.code) + ", and sets " +
                                        fourcc_text(got.code) + "; change format in rig.toml"));
  }
  if (got.width != wanted.width || got.height != wanted.height) {
    return fail(
        unsupported(device, fmt::format("does not deliver {}x{} but {}x{}{}; change size in rig.toml", wanted.width,
                                        wanted.height, got.width, got.height, sizes_of(device, got.code))));
  }
  const auto fields = fields_of(got.field, granted.interlaced);
  if (!fields || *fields != request.fields) {
    const bool ours = fields && *fields != Fields::kTopOnly && *fields != Fields::kBottomOnly;
    return fail(
        unsupported(device, "delivers " + (ours ? std::string(fields_name(*fields)) : std::string("separate fields")) +
                                ", not " + std::string(fields_name(request.fields)) +
                                (ours ? "; write fields = \"" + std::string(fields_name(*fields)) + "\" in rig.toml"
                                      : "; choose another standard or input in rig.toml")));
  }
  const bool planar = component_count(request.pixels) > 1 && code.pixels != PixelFormat::kYuyv &&
                      code.pixels != PixelFormat::kUyvy && code.pixels != PixelFormat::kRgb24;
  if (granted.storage == FieldStorage::kSequential && (planar || got.height % 2 != 0)) {
    return fail(unsupported(device,
                            "delivers the fields of a frame one after the other, which is only supported for YUYV, "
                            "UYVY, RGB24 and GREY of even height; change format in rig.toml"));
  }
  auto layout = make_layout(code, static_cast<int>(got.width), buffer_height, got.strides);
  if (!layout) return fail(layout.error().in("head '" + device.head() + "'"));
  NODAL_TRY(set_rate(device, request.rate, standard));

  granted.layout = *layout;
  NODAL_TRY_ASSIGN(const auto coding, coding_of(device, got, request.pixels));
  granted.coding = coding;
  granted.format = {request.pixels, layout->width, static_cast<int>(got.height), request.fields, request.rate};
  // A timestamp is taken at the end of its buffer: of a frame, or of its first field.
  const Duration period = request.rate.period();
  granted.readout = request.readout.value_or(granted.storage == FieldStorage::kAlternate ? period / 2 : period);
  return granted;
}

bool no_signal(const Device& device, std::uint32_t input) {
  v4l2_input about{};
  about.index = input;
  if (device.ioctl(VIDIOC_ENUMINPUT, &about) != 0) return false;
  return (about.status & (V4L2_IN_ST_NO_POWER | V4L2_IN_ST_NO_SIGNAL | V4L2_IN_ST_NO_H_LOCK | V4L2_IN_ST_NO_SYNC)) != 0;
}

}  // namespace nodal::hal::v4l2
