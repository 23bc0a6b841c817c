#include "stitch/media/tiff/tiff_reader.h"

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"
#include "stitch/media/file_kind.h"
#include "stitch/media/linear_words.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/tiff/colorimetry.h"
#include "stitch/media/tiff/exif_block.h"
#include "stitch/media/tiff/memory.h"

namespace nodal::media {
namespace {

constexpr std::uint32_t kMaxSide = 32768;
/// Decoded bytes per byte of file. Deflate expands at most 1032 times, LZW and runs of one colour less.
constexpr std::uint64_t kMaxExpansion = 3096;
constexpr std::uint64_t kMaxBlock = std::uint64_t{1} << 30;  // bytes of a strip or a tile
constexpr std::uint64_t kSmall = std::uint64_t{1} << 20;     // bytes; a picture this small may claim any expansion

/// A file and what libtiff says of it.
struct Reader {
  std::string name;
  std::uint64_t file_bytes = 0;
  TiffMemory memory{};
  TiffPtr tiff{};
  ImageHeader header{};

  Error error(Errc code, const std::string& text) const { return {code, "picture '" + name + "': " + text}; }
  Error broken(Errc code, const std::string& how) const {
    return error(code, "the TIFF " + how + " (" + memory.why + "); fetch or export it again");
  }
};

template <class Value>
Value field(TIFF* tiff, std::uint32_t tag, Value otherwise) {
  Value value = otherwise;
  return TIFFGetFieldDefaulted(tiff, tag, &value) == 1 ? value : otherwise;
}

Status check_size(Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  const auto width = field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH, 0);
  const auto height = field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH, 0);
  const std::string size = fmt::format("{}x{}", width, height);
  if (width == 0 || height == 0) return fail(reader.error(Errc::kBadFormat, "the TIFF has " + size + " pixels"));
  if (width > kMaxSide || height > kMaxSide) {
    return fail(reader.error(Errc::kTooLarge, fmt::format("is {}, over the limit of {} a side", size, kMaxSide)));
  }
  if (std::uint64_t{width} * height > kMaxPicturePixels) {
    return fail(reader.error(Errc::kTooLarge,
                             fmt::format("is {}, over the limit of {} * 2^20 pixels", size, kMaxPicturePixels >> 20)));
  }
  if (std::uint64_t{width} * height * 3 > kSmall + kMaxExpansion * reader.file_bytes) {
    return fail(reader.error(Errc::kTruncated, fmt::format("{} bytes cannot hold {} pixels; fetch or export it again",
                                                           reader.file_bytes, size)));
  }
  const auto light = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  const bool grey = light == PHOTOMETRIC_MINISBLACK || light == PHOTOMETRIC_MINISWHITE;
  reader.header = {static_cast<int>(width), static_cast<int>(height), grey ? PixelFormat::kGrey8 : PixelFormat::kRgb24};
  if ((grey || light == PHOTOMETRIC_RGB) && field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) == 16 &&
      field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1) >= (grey ? 1 : 3) &&
      field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT) {
    reader.header.deep = grey ? PixelFormat::kGrey16 : PixelFormat::kRgb48;
  }
  return {};
}

Error too_large(const Reader& reader) {
  return reader.error(Errc::kTooLarge, fmt::format("is over {} MiB", kMaxTiffFileBytes >> 20));
}

Status open(PictureBytes& file, Reader& reader) {
  NODAL_TRY(file.first(kMaxTiffFileBytes + 1));
  reader.memory.bytes = file.take();
  reader.file_bytes = reader.memory.bytes.size();
  if (reader.file_bytes > kMaxTiffFileBytes) return fail(too_large(reader));
  reader.tiff = open_tiff(reader.memory, "r");
  if (!reader.tiff) return fail(reader.broken(Errc::kBadFormat, "is broken"));
  return check_size(reader);
}

/// Reads only the file's directory.
Status open_directory(const PictureBytes& file, Reader& reader) {
  reader.file_bytes = file.size();
  if (reader.file_bytes > kMaxTiffFileBytes) return fail(too_large(reader));
  const int descriptor = ::dup(file.descriptor());
  if (descriptor < 0 || ::lseek(descriptor, 0, SEEK_SET) != 0) {
    return fail(reader.error(Errc::kIo, std::string("cannot be read: ") + std::strerror(errno)));
  }
  reader.tiff = open_tiff_file(descriptor, reader.memory);
  if (!reader.tiff) return fail(reader.broken(Errc::kBadFormat, "is broken"));
  return check_size(reader);
}

/// What the channel behind the colours is: kAssociated if the colours are multiplied by it (TIFF 6.0, ExtraSamples).
enum class Alpha : std::uint8_t { kNone, kAssociated, kUnassociated };

bool is_plain_light(TIFF* tiff) {
  const auto light = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  return light == PHOTOMETRIC_MINISBLACK || light == PHOTOMETRIC_MINISWHITE || light == PHOTOMETRIC_RGB;
}

Alpha alpha_of(const Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  std::uint16_t extra = 0;
  const std::uint16_t* kinds = nullptr;
  const int colours = component_count(reader.header.natural);
  if (!is_plain_light(tiff) || TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &extra, &kinds) != 1 || extra == 0 ||
      field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1) <= colours) {
    return Alpha::kNone;
  }
  return kinds[0] == EXTRASAMPLE_ASSOCALPHA   ? Alpha::kAssociated
         : kinds[0] == EXTRASAMPLE_UNASSALPHA ? Alpha::kUnassociated
                                              : Alpha::kNone;
}

/// Whether decode_plain() reads it.
bool is_plain(const Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  return reader.header.deep ||
         (is_plain_light(tiff) && field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) == 8 &&
          field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT &&
          alpha_of(reader) != Alpha::kNone);
}

/// Its colours, XMP, Exif and comment.
void read_notes(const Reader& reader, DecodedImage& picture) {
  TIFF* tiff = reader.tiff.get();
  std::uint32_t length = 0;
  const std::uint8_t* bytes = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_ICCPROFILE, &length, &bytes) == 1 && bytes != nullptr) {
    picture.meaning.icc.assign(bytes, bytes + length);
  } else {
    read_colorimetry(tiff, picture.meaning);
  }
  const char* text = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_XMLPACKET, &length, &text) == 1 && text != nullptr) {
    picture.metadata.xmp.assign(text, length);
  }
  if (TIFFGetField(tiff, TIFFTAG_IMAGEDESCRIPTION, &text) == 1 && text != nullptr &&
      std::string_view(text).starts_with(kLinearWords)) {
    picture.meaning.curve = SampleMeaning::Curve::kGamma;
    picture.meaning.full_exposure_ns = full_exposure_said(text);
  }
  picture.meaning.alpha = alpha_of(reader) != Alpha::kNone;
  picture.metadata.exif = exif_block(reader.memory.bytes);
}

/// How the samples of a grey or RGB picture with 8 or 16 bits lie in its strips or tiles.
struct Blocks {
  bool tiled = false;
  std::uint32_t across = 0, down = 0;  ///< pixels of a block
  std::uint32_t planes = 1;            ///< 1: channels are interleaved
  std::uint32_t stored = 1;            ///< samples of a pixel in a block
  std::uint32_t channels = 1;          ///< 1 or 3 of them are of use, and alpha
  Alpha alpha = Alpha::kNone;          ///< meaning of the channel that follows
  std::size_t sample_bytes = 2;
  tmsize_t bytes = 0;
};

/// A pixel's sample of each channel, and alpha behind them.
using PlainPixel = std::array<std::uint16_t, 4>;

Result<Blocks> plain_blocks(const Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  Blocks blocks;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const std::uint32_t samples = field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  blocks.tiled = TIFFIsTiled(tiff) != 0;
  blocks.across = blocks.tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH, 0) : width;
  blocks.down = blocks.tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)
                             : std::min(height, field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height));
  const bool by_plane =
      samples > 1 && field<std::uint16_t>(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) == PLANARCONFIG_SEPARATE;
  blocks.planes = by_plane ? samples : 1;
  blocks.stored = by_plane ? 1 : samples;
  blocks.channels = static_cast<std::uint32_t>(component_count(reader.header.natural));
  blocks.alpha = alpha_of(reader);
  blocks.sample_bytes = field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) / 8;
  blocks.bytes = blocks.tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  const std::uint64_t wanted = blocks.sample_bytes * blocks.across * blocks.down * blocks.stored;
  if (blocks.across == 0 || blocks.down == 0 || blocks.bytes <= 0 || wanted > kMaxBlock ||
      static_cast<std::uint64_t>(blocks.bytes) < wanted || static_cast<std::uint64_t>(blocks.bytes) > kMaxBlock) {
    return fail(reader.error(Errc::kUnsupported, "the TIFF has unusual strips or tiles; export it again"));
  }
  return blocks;
}

/// Converts pixels to samples that stand for light, whatever alpha is.
class PlainSamples {
 public:
  PlainSamples(const Blocks& blocks, bool white_is_0)
      : alpha_(blocks.alpha),
        channels_(blocks.channels),
        most_(blocks.sample_bytes == 1 ? 255 : 65535),
        white_is_0_(white_is_0) {}

  void convert(std::span<const PlainPixel> pixels, std::span<std::uint16_t> samples) const {
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const PlainPixel& pixel = pixels[k / channels_];
      std::uint32_t value = pixel[k % channels_];
      if (white_is_0_) value = most_ - value;
      const std::uint32_t alpha = pixel[channels_];
      // Where nothing is opaque there is no colour to restore.
      if (alpha_ == Alpha::kAssociated && alpha > 0) value = std::min(most_, (value * most_ + alpha / 2) / alpha);
      samples[k] = static_cast<std::uint16_t>(value);
    }
  }

 private:
  Alpha alpha_;
  std::size_t channels_;
  std::uint32_t most_;
  bool white_is_0_;
};

/// Which channels are taken.
enum class Taken : std::uint8_t { kColours, kOpacity };

/// Grey and RGB with all their 8 or 16 bits, or their alpha: calls row(samples) for every row of the picture, from the
/// top. Memory is taken for a row of strips or tiles at a time.
template <class Row>
Status decode_plain(Reader& reader, const Row& row, Taken wanted = Taken::kColours) {
  TIFF* tiff = reader.tiff.get();
  NODAL_TRY_ASSIGN(const Blocks found, plain_blocks(reader));
  const Blocks& blocks = found;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const PlainSamples made(blocks, field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, 0) == PHOTOMETRIC_MINISWHITE);
  const std::uint32_t blocks_across = (width + blocks.across - 1) / blocks.across;
  const std::uint32_t blocks_down = (height + blocks.down - 1) / blocks.down;
  const bool opacity = wanted == Taken::kOpacity;
  const std::uint32_t used = blocks.channels + (blocks.alpha == Alpha::kAssociated || opacity ? 1 : 0);
  const std::uint32_t planes = std::min(blocks.planes, used);
  std::vector<std::uint16_t> block(static_cast<std::size_t>(blocks.bytes) / 2 + 1);
  const auto* const narrow = reinterpret_cast<const std::uint8_t*>(block.data());
  std::vector<PlainPixel> pixels;
  std::vector<std::uint16_t> samples(std::size_t{width} * (opacity ? 1 : blocks.channels));
  for (std::uint32_t top = 0; top < height; top += blocks.down) {
    const std::uint32_t rows = std::min(blocks.down, height - top);
    for (std::uint32_t b = 0; b < blocks_across * planes; ++b) {
      const std::uint32_t plane = b / blocks_across, left = b % blocks_across * blocks.across;
      const std::uint32_t number = (plane * blocks_down + top / blocks.down) * blocks_across + left / blocks.across;
      const tmsize_t got = blocks.tiled ? TIFFReadEncodedTile(tiff, number, block.data(), blocks.bytes)
                                        : TIFFReadEncodedStrip(tiff, number, block.data(), blocks.bytes);
      if (got < static_cast<tmsize_t>(blocks.sample_bytes * blocks.across * rows * blocks.stored)) {
        return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
      }
      pixels.resize(std::size_t{width} * rows);
      const std::size_t taken = blocks.planes > 1 ? 1 : used;
      for (std::uint32_t y = 0; y < rows; ++y) {
        for (std::uint32_t x = 0; x < std::min(blocks.across, width - left); ++x) {
          const std::size_t from = (std::size_t{y} * blocks.across + x) * blocks.stored;
          std::uint16_t* const to = &pixels[std::size_t{y} * width + left + x][plane];
          if (blocks.sample_bytes == 1) {
            std::copy_n(narrow + from, taken, to);
          } else {
            std::copy_n(&block[from], taken, to);
          }
        }
      }
    }
    for (std::uint32_t y = 0; y < rows; ++y) {
      const auto line = std::span<const PlainPixel>(pixels).subspan(std::size_t{y} * width, width);
      if (opacity) std::ranges::transform(line, samples.begin(), [&](const auto& p) { return p[blocks.channels]; });
      else made.convert(line, samples);
      row(std::span<const std::uint16_t>(samples));
    }
  }
  return {};
}

void append_in_8_bits(std::span<const std::uint16_t> row, bool deep, std::vector<std::uint8_t>& bytes) {
  for (const unsigned value : row) bytes.push_back(static_cast<std::uint8_t>(deep ? (value + 128) / 257 : value));
}

/// libtiff's own conversion to 8 bits: red in the lowest byte. Rows are appended to `bytes` as they are decoded, those
/// of a row of strips or tiles at a time, so that a file that ends early takes no memory for the rest.
Status decode(Reader& reader, std::vector<std::uint8_t>& bytes) {
  TIFF* tiff = reader.tiff.get();
  TIFFRGBAImage image{};
  std::array<char, 1024> why{};
  if (TIFFRGBAImageOK(tiff, why.data()) == 0 || TIFFRGBAImageBegin(&image, tiff, 1, why.data()) == 0) {
    return fail(reader.error(Errc::kUnsupported, std::string("this kind of TIFF cannot be read (") + why.data() +
                                                     "); export it with 8 or 16 bits"));
  }
  const std::unique_ptr<TIFFRGBAImage, decltype(&TIFFRGBAImageEnd)> end(&image, TIFFRGBAImageEnd);
  image.req_orientation = image.orientation;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const bool grey = reader.header.natural == PixelFormat::kGrey8;
  const auto stored = TIFFIsTiled(tiff) != 0 ? field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)
                                             : field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height);
  const std::uint32_t at_once = std::clamp(stored, std::uint32_t{1}, height);
  std::vector<std::uint32_t> pixels(std::size_t{width} * at_once);
  for (std::uint32_t top = 0; top < height; top += at_once) {
    const std::uint32_t rows = std::min(at_once, height - top);
    image.row_offset = static_cast<int>(top);
    if (TIFFRGBAImageGet(&image, pixels.data(), width, rows) != 1) {
      return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
    }
    for (const std::uint32_t pixel : std::span(pixels).first(std::size_t{width} * rows)) {
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetR(pixel)));
      if (grey) continue;
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetG(pixel)));
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetB(pixel)));
    }
  }
  return {};
}

}  // namespace

bool is_tiff(PictureBytes& file) {
  const auto head = file.first(kFileKindBytes);
  return head && begins_like_tiff(*head) && file_kind(*head, file.name()) == nullptr;
}

Result<ImageHeader> tiff_header(const PictureBytes& file) {
  Reader reader{file.name()};
  NODAL_TRY(open_directory(file, reader));
  return reader.header;
}

Result<DecodedImage> decode_tiff(PictureBytes& file, std::optional<PixelFormat> as) {
  Reader reader{file.name()};
  NODAL_TRY(open(file, reader));
  const ImageHeader& header = reader.header;
  if (as && as != header.deep) {
    return fail(reader.error(Errc::kUnsupported,
                             "does not have 16 bits a sample as " + std::string(pixel_format_name(*as)) + " needs"));
  }
  DecodedImage picture{as ? *as : header.natural, header.width, header.height, {}};
  std::vector<std::uint8_t>& bytes = picture.bytes;
  bytes.reserve(packed_size(picture.format, picture.width, picture.height));
  Status decoded;
  if (as) {
    decoded = decode_plain(reader, [&bytes](std::span<const std::uint16_t> row) {
      const auto* first = reinterpret_cast<const std::uint8_t*>(row.data());
      bytes.insert(bytes.end(), first, first + row.size_bytes());
    });
  } else if (is_plain(reader)) {
    decoded = decode_plain(reader, [&](auto row) { append_in_8_bits(row, header.deep.has_value(), bytes); });
  } else {
    decoded = decode(reader, bytes);
  }
  if (!decoded) return fail(decoded.error());
  read_notes(reader, picture);
  return picture;
}

Result<DecodedImage> decode_tiff_opacity(PictureBytes& file) {
  Reader reader{file.name()};
  NODAL_TRY(open(file, reader));
  DecodedImage opacity{PixelFormat::kGrey8, reader.header.width, reader.header.height, {}};
  if (alpha_of(reader) == Alpha::kNone || !is_plain(reader)) {
    opacity.bytes.assign(packed_size(opacity.format, opacity.width, opacity.height), 255);
    return opacity;
  }
  const bool deep = reader.header.deep.has_value();
  NODAL_TRY(decode_plain(
      reader, [&](auto row) { append_in_8_bits(row, deep, opacity.bytes); }, Taken::kOpacity));
  return opacity;
}

bool is_tiff(const std::filesystem::path& file) {
  Result<PictureBytes> bytes = PictureBytes::open(file);
  return bytes && is_tiff(*bytes);
}

Result<DecodedImage> read_tiff(const std::filesystem::path& file, std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(PictureBytes bytes, PictureBytes::open(file));
  return decode_tiff(bytes, as);
}

Result<ImageHeader> read_tiff_header(const std::filesystem::path& file) {
  NODAL_TRY_ASSIGN(const PictureBytes bytes, PictureBytes::open(file));
  return tiff_header(bytes);
}

}  // namespace nodal::media
