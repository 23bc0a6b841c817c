// A file in pieces: all of it, parts of it, and a disk that fails in between.
#include "firmware/storage/file_pieces.h"

#include <gtest/gtest.h>

#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

std::vector<std::uint8_t> numbered(std::size_t size) {
  std::vector<std::uint8_t> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7 + (i >> 8) * 13 + (i >> 16));
  return bytes;
}

void put(SimDisk& disk, const std::string& name, std::span<const std::uint8_t> bytes) {
  const auto file = disk.create(name);
  ASSERT_TRUE(file && disk.write(*file, bytes));
  disk.close(*file);
}

std::vector<std::uint8_t> all_of(FilePieces& pieces) {
  std::vector<std::uint8_t> bytes;
  const Status read = for_each_piece(pieces, [&](std::span<const std::uint8_t> piece) {
    EXPECT_LE(piece.size(), FilePieces::kPiece);
    bytes.insert(bytes.end(), piece.begin(), piece.end());
    return true;
  });
  EXPECT_TRUE(read) << read.error().text();
  return bytes;
}

TEST(FilePiecesTest, FilesOfAnyLength_ComeWholeInPieces) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, FilePieces::kPiece - 1, FilePieces::kPiece,
                                 FilePieces::kPiece + 1, 2 * FilePieces::kPiece + 5}) {
    SimDisk disk;
    const auto bytes = numbered(size);
    put(disk, "file", bytes);
    FilePieces pieces(disk, "file");
    EXPECT_TRUE(all_of(pieces) == bytes) << size;
    EXPECT_EQ(pieces.at(), size);
  }
}

TEST(FilePiecesTest, APartOfAFile_IsReadFromItsFrontToItsEndAndNotBeyond) {
  SimDisk disk;
  const auto bytes = numbered(2 * FilePieces::kPiece + 100);
  put(disk, "file", bytes);
  const auto part = [&](std::uint64_t from, std::uint64_t to) {
    FilePieces pieces(disk, "file", from, to);
    return all_of(pieces);
  };
  EXPECT_TRUE(part(10, FilePieces::kPiece + 20) ==
              std::vector(bytes.begin() + 10, bytes.begin() + FilePieces::kPiece + 20));
  EXPECT_TRUE(part(100, 101) == std::vector(bytes.begin() + 100, bytes.begin() + 101));
  EXPECT_TRUE(part(7, 7).empty());
  EXPECT_TRUE(part(8, 7).empty());
  EXPECT_TRUE(part(bytes.size() - 3, FilePieces::kAll) == std::vector(bytes.end() - 3, bytes.end()));
}

TEST(FilePiecesTest, ItsText_IsTheSameBytes) {
  SimDisk disk;
  put(disk, "file", std::vector<std::uint8_t>{'a', 'b', 'c'});
  FilePieces pieces(disk, "file");
  const auto text = pieces.next_text();
  ASSERT_TRUE(text);
  EXPECT_EQ(*text, "abc");
  FilePieces absent(disk, "absent");
  const auto none = absent.next_text();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
}

TEST(FilePiecesTest, TheReaderHasEnough_NoFurtherPieceIsRead) {
  SimDisk disk;
  put(disk, "file", numbered(3 * FilePieces::kPiece));
  FilePieces pieces(disk, "file");
  int seen = 0;
  ASSERT_TRUE(for_each_piece(pieces, [&](std::span<const std::uint8_t>) { return ++seen < 2; }));
  EXPECT_EQ(seen, 2);
  EXPECT_EQ(pieces.at(), 2 * FilePieces::kPiece);
}

TEST(FilePiecesTest, AReadFails_ItIsAnErrorAndTheNextCallGoesOnThere) {
  SimDisk disk;
  const auto bytes = numbered(FilePieces::kPiece + 9);
  put(disk, "file", bytes);
  FilePieces pieces(disk, "file");
  ASSERT_TRUE(pieces.next());
  disk.fail_reads(1);
  EXPECT_EQ(for_each_piece(pieces, [](std::span<const std::uint8_t>) { return true; }).error().code, Errc::kIo);
  const auto rest = pieces.next();
  ASSERT_TRUE(rest);
  EXPECT_TRUE(std::equal(rest->begin(), rest->end(), bytes.begin() + FilePieces::kPiece, bytes.end()));
}

TEST(FilePiecesTest, ItIsRemovedMeanwhile_TheOpenOneIsReadToItsEndAndThenClosed) {
  SimDisk disk;
  const auto bytes = numbered(FilePieces::kPiece + 9);
  put(disk, "file", bytes);
  FilePieces pieces(disk, "file");
  ASSERT_TRUE(pieces.next());
  ASSERT_TRUE(disk.remove("file"));
  const auto rest = pieces.next();
  ASSERT_TRUE(rest);
  EXPECT_EQ(rest->size(), 9u);
  const auto end = pieces.next();
  ASSERT_TRUE(end);
  EXPECT_TRUE(end->empty());
  EXPECT_EQ(pieces.next().error().code, Errc::kNotFound) << "it is closed at its end";
}

}  // namespace
}  // namespace nodal::firmware
