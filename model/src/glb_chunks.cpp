#include <string>

#include "limber/core/error.h"
#include "limber/internal/glb_container.h"
#include "limber/model/glb.h"

namespace limber {

using namespace internal;  // the container's numbers

GlbChunks glb_chunks(std::string_view bytes, const std::string& name) {
  const auto fail = [&](const std::string& what) { throw InputError(name + ": " + what); };
  if (bytes.size() < kGlbHeaderSize || u32_at(bytes, 0) != kGlbMagic)
    fail("is not a GLB file (it does not begin with \"glTF\")");
  if (u32_at(bytes, 4) != kGlbVersion)
    fail("is a GLB of version " + std::to_string(u32_at(bytes, 4)) + ", expected version 2");
  if (u32_at(bytes, 8) != bytes.size())
    fail("its header tells " + std::to_string(u32_at(bytes, 8)) + " bytes, the file has " +
         std::to_string(bytes.size()) + ": it is cut short or was changed");
  GlbChunks chunks;
  std::size_t offset = kGlbHeaderSize;
  for (const std::uint32_t type : {kJsonChunk, kBinChunk}) {
    if (offset == bytes.size() && type == kBinChunk) break;
    if (bytes.size() - offset < kChunkHeaderSize) fail("ends inside a chunk header, at byte " + std::to_string(offset));
    const std::uint32_t size = u32_at(bytes, offset);
    if (u32_at(bytes, offset + 4) != type)
      fail("the chunk at byte " + std::to_string(offset) + " is not the " + (type == kJsonChunk ? "JSON" : "BIN") +
           " chunk that was expected there");
    offset += kChunkHeaderSize;
    if (size > bytes.size() - offset || size % 4 != 0)
      fail("the chunk at byte " + std::to_string(offset) + " has " + std::to_string(size) +
           " bytes, expected a multiple of 4 and at most " + std::to_string(bytes.size() - offset));
    (type == kJsonChunk ? chunks.json : chunks.binary) = bytes.substr(offset, size);
    offset += size;
  }
  if (offset != bytes.size()) fail("has bytes after its last chunk, at byte " + std::to_string(offset));
  return chunks;
}

}  // namespace limber
