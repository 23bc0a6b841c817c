// Pieces of a take's files, as hosts ask for them, also for what is not there and from a disk that fails.
#include "firmware/record/take_reader.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;
using ReadBytes = std::vector<std::uint8_t>;

/// A disk with the finished take 1, and a reader of it.
struct ReaderWorld {
  ReaderWorld() {
    EXPECT_TRUE(stage.start().result);
    stage.run(Duration::seconds(1));
    EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  }
  Result<PieceOfTake> read(std::uint64_t take, const std::string& file, std::uint64_t offset = 0) {
    EXPECT_TRUE(reader.orders().push({9, take, file, offset}));
    EXPECT_TRUE(reader.step());
    auto answer = reader.answers().pop();
    if (!answer) return fail(Errc::kTimeout, "no answer");
    EXPECT_EQ(answer->transfer, 9U);
    EXPECT_EQ(answer->offset, offset);
    return std::move(answer->piece);
  }
  Errc refusal(std::uint64_t take, const std::string& file, std::uint64_t offset = 0) {
    const auto piece = read(take, file, offset);
    EXPECT_FALSE(piece) << file;
    return piece ? Errc::kInternal : piece.error().code;
  }

  SimDisk disk;
  hal::sim::SimClock clock;
  TakeStage stage{disk, clock, {}};
  TakeReader reader{disk, stage.recorder(), stage.in_use()};
};

TEST(TakeReader, AFile_IsReadInPiecesUpToItsEnd) {
  ReaderWorld world;
  ReadBytes bytes(TakeReader::kPiece + 5);
  for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<std::uint8_t>(k * 7 + k / 256);
  world.disk.put("000001/cam7-0000.mkv", bytes);
  const auto first = world.read(1, "cam7-0000.mkv");
  ASSERT_TRUE(first) << first.error().text();
  EXPECT_EQ(first->file_bytes, bytes.size());
  const auto middle = bytes.begin() + static_cast<std::ptrdiff_t>(TakeReader::kPiece);
  EXPECT_EQ(*first->bytes, ReadBytes(bytes.begin(), middle));
  const auto rest = world.read(1, "cam7-0000.mkv", TakeReader::kPiece);
  ASSERT_TRUE(rest) << rest.error().text();
  EXPECT_EQ(rest->file_bytes, bytes.size());
  EXPECT_EQ(*rest->bytes, ReadBytes(middle, bytes.end()));
  const auto end = world.read(1, "cam7-0000.mkv", bytes.size());
  ASSERT_TRUE(end) << end.error().text();
  EXPECT_TRUE(end->bytes->empty());
  EXPECT_EQ(world.refusal(1, "cam7-0000.mkv", bytes.size() + 1), Errc::kBadValue);
}

TEST(TakeReader, WhatIsNoFileOfATake_IsRefusedAlsoIfItIsThere) {
  ReaderWorld world;
  world.disk.put("000001/notes.txt", ReadBytes{'x'});
  for (const char* name : {"notes.txt", "../000001/manifest", "", "/etc/passwd"}) {
    EXPECT_EQ(world.refusal(1, name), Errc::kBadValue) << name;
  }
}

TEST(TakeReader, WhatIsNotThere_IsNamedByItsKind) {
  ReaderWorld world;
  EXPECT_EQ(world.refusal(2, take::kManifestFile), Errc::kNotFound);
  EXPECT_EQ(world.refusal(1, "cam9-0000.mkv"), Errc::kNotFound);
  ASSERT_TRUE(world.stage.start().result);
  EXPECT_EQ(world.refusal(2, take::kTakeFile), Errc::kWrongState) << "it is being recorded";
}

TEST(TakeReader, TheDiskFails_TheAnswerIsItsErrorAndTheNextReadIsGood) {
  ReaderWorld world;
  world.disk.spoil("000001/manifest", 10);
  EXPECT_EQ(world.refusal(1, take::kManifestFile), Errc::kIo);
  EXPECT_FALSE(world.stage.in_use().is_read()) << "an eject need not wait";
  world.disk.spoil("", 0);
  EXPECT_TRUE(world.read(1, take::kManifestFile));
}

TEST(TakeReader, Ejected_NothingIsOpenedUntilTheDiskIsUsedAgain) {
  ReaderWorld world;
  world.stage.in_use().set_ejected(true);
  EXPECT_EQ(world.refusal(1, take::kManifestFile), Errc::kNotReady);
  EXPECT_FALSE(world.stage.in_use().is_read());
  world.stage.in_use().set_ejected(false);
  EXPECT_TRUE(world.read(1, take::kManifestFile));
  EXPECT_FALSE(world.stage.in_use().is_read());
}

TEST(TakeReader, NoOrder_ItDoesNothing) {
  ReaderWorld world;
  EXPECT_FALSE(world.reader.step());
  EXPECT_FALSE(world.reader.answers().pop());
}

}  // namespace
}  // namespace nodal::firmware
