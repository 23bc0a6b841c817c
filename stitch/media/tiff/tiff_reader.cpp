#include "stitch/media/tiff/tiff_reader.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stitch/media/tiff/memory.h"

namespace nodal::media {
namespace {

constexpr std::uint32_t kMostSide = 32768;
/// Decoded bytes per byte of file. Deflate expands at most 1032 times, LZW and runs of one colour less.
constexpr std::uint64_t kMostExpansion = 3096;
constexpr std::uint64_t kMostBlock = std::uint64_t{1} << 30;  // bytes of a strip or a tile
constexpr std::uint64_t kSmall = std::uint64_t{1} << 20;      // bytes; a picture this small may claim any expansion

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

/// A file and what libtiff says of it.
struct Reader {
  std::string name;
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
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width == 0 || height == 0) return fail(reader.error(Errc::kBadFormat, "the TIFF has " + size + " pixels"));
  if (width > kMostSide || height > kMostSide) {
    return fail(
        reader.error(Errc::kTooLarge, "is " + size + ", over the limit of " + std::to_string(kMostSide) + " a side"));
  }
  if (std::uint64_t{width} * height * 3 > kSmall + kMostExpansion * reader.memory.bytes.size()) {
    return fail(reader.error(Errc::kTruncated, std::to_string(reader.memory.bytes.size()) + " bytes cannot hold " +
                                                   size + " pixels; fetch or export it again"));
  }
  const auto light = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  const bool grey = light == PHOTOMETRIC_MINISBLACK || light == PHOTOMETRIC_MINISWHITE;
  reader.header = {static_cast<int>(width), static_cast<int>(height), grey ? PixelFormat::kGrey8 : PixelFormat::kRgb24};
  return {};
}

Status open(const std::filesystem::path& file, Reader& reader) {
  const std::unique_ptr<std::FILE, CloseFile> in(std::fopen(file.c_str(), "rb"));
  if (!in) {
    return fail(reader.error(errno == ENOENT || errno == ENOTDIR ? Errc::kNotFound : Errc::kIo,
                             std::string("cannot be opened: ") + std::strerror(errno)));
  }
  std::vector<std::uint8_t>& bytes = reader.memory.bytes;
  std::vector<std::uint8_t> piece(std::size_t{1} << 16);
  while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), in.get())) {
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
    if (bytes.size() > kMaxTiffFileBytes) {
      return fail(reader.error(Errc::kTooLarge, "is over " + std::to_string(kMaxTiffFileBytes >> 20) + " MiB"));
    }
  }
  if (std::ferror(in.get()) != 0) {
    return fail(reader.error(Errc::kIo, std::string("cannot be read: ") + std::strerror(errno)));
  }
  reader.tiff = open_tiff(reader.memory, "r");
  if (!reader.tiff) return fail(reader.broken(Errc::kBadFormat, "is broken"));
  return check_size(reader);
}

bool is_deep_grey(const Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  return reader.header.natural == PixelFormat::kGrey8 && field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) == 16 &&
         field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1) == 1 &&
         field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT;
}

/// Grey of 16 bits, which libtiff 4.5 converts wrongly in tiles that reach beyond the picture.
Status decode_deep_grey(Reader& reader, std::vector<std::uint8_t>& bytes) {
  TIFF* tiff = reader.tiff.get();
  const bool tiled = TIFFIsTiled(tiff) != 0;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const auto across = tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH, 0) : width;
  const auto down = tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)
                          : std::min(height, field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height));
  const tmsize_t size = tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  const std::uint64_t wanted = std::uint64_t{2} * across * down;
  if (across == 0 || down == 0 || size <= 0 || wanted > kMostBlock || static_cast<std::uint64_t>(size) < wanted) {
    return fail(reader.error(Errc::kUnsupported, "the TIFF has unusual strips or tiles; export it again"));
  }
  const bool white_is_0 = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, 0) == PHOTOMETRIC_MINISWHITE;
  std::vector<std::uint16_t> block(static_cast<std::size_t>(size) / 2 + 1);
  bytes.resize(std::size_t{width} * height);
  std::uint32_t number = 0;
  for (std::uint32_t top = 0; top < height; top += down) {
    for (std::uint32_t left = 0; left < width; left += across, ++number) {
      const tmsize_t got = tiled ? TIFFReadEncodedTile(tiff, number, block.data(), size)
                                 : TIFFReadEncodedStrip(tiff, number, block.data(), size);
      const std::uint32_t rows = std::min(down, height - top);
      if (got < static_cast<tmsize_t>(2 * std::size_t{across} * rows)) {
        return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
      }
      for (std::uint32_t y = 0; y < rows; ++y) {
        for (std::uint32_t x = 0; x < std::min(across, width - left); ++x) {
          const unsigned value = (block[std::size_t{y} * across + x] + 128U) / 257U;
          bytes[std::size_t{top + y} * width + left + x] = static_cast<std::uint8_t>(white_is_0 ? 255U - value : value);
        }
      }
    }
  }
  return {};
}

/// libtiff's own conversion to 8 bits: red in the lowest byte.
Status decode(Reader& reader, std::vector<std::uint32_t>& pixels) {
  TIFFRGBAImage image{};
  std::array<char, 1024> why{};
  if (TIFFRGBAImageOK(reader.tiff.get(), why.data()) == 0 ||
      TIFFRGBAImageBegin(&image, reader.tiff.get(), 1, why.data()) == 0) {
    return fail(reader.error(Errc::kUnsupported, std::string("this kind of TIFF cannot be read (") + why.data() +
                                                     "); export it with 8 or 16 bits"));
  }
  image.req_orientation = image.orientation;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  pixels.resize(std::size_t{width} * height);
  const bool good = TIFFRGBAImageGet(&image, pixels.data(), width, height) == 1;
  TIFFRGBAImageEnd(&image);
  if (!good) return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
  return {};
}

}  // namespace

bool is_tiff(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  const std::unique_ptr<std::FILE, CloseFile> in(std::fopen(file.c_str(), "rb"));
  std::array<char, 4> first{};
  if (!in || std::fread(first.data(), 1, first.size(), in.get()) != first.size()) return false;
  const std::string_view start(first.data(), first.size());
  using namespace std::string_view_literals;
  return start == "II*\0"sv || start == "MM\0*"sv || start == "II+\0"sv || start == "MM\0+"sv;
}

Result<ImageHeader> read_tiff_header(const std::filesystem::path& file) {
  Reader reader{file.string()};
  if (const Status opened = open(file, reader); !opened) return fail(opened.error());
  return reader.header;
}

Result<DecodedImage> read_tiff(const std::filesystem::path& file) {
  Reader reader{file.string()};
  if (const Status opened = open(file, reader); !opened) return fail(opened.error());
  if (is_deep_grey(reader)) {
    DecodedImage grey{PixelFormat::kGrey8, reader.header.width, reader.header.height, {}};
    if (const Status decoded = decode_deep_grey(reader, grey.bytes); !decoded) return fail(decoded.error());
    return grey;
  }
  std::vector<std::uint32_t> pixels;
  if (const Status decoded = decode(reader, pixels); !decoded) return fail(decoded.error());
  DecodedImage picture{reader.header.natural, reader.header.width, reader.header.height, {}};
  const bool grey = picture.format == PixelFormat::kGrey8;
  picture.bytes.reserve(packed_size(picture.format, picture.width, picture.height));
  for (const std::uint32_t pixel : pixels) {
    picture.bytes.push_back(static_cast<std::uint8_t>(TIFFGetR(pixel)));
    if (grey) continue;
    picture.bytes.push_back(static_cast<std::uint8_t>(TIFFGetG(pixel)));
    picture.bytes.push_back(static_cast<std::uint8_t>(TIFFGetB(pixel)));
  }
  return picture;
}

}  // namespace nodal::media
