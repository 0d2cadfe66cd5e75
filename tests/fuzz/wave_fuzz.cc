// Fuzz target: sound files of a take. They are rejected with one line, or read to a whole number of
// samples.
#include "fuzz_input.h"
#include "sound/wave_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  auto reader = v3d::sound::WaveReader::parse({data, data + size}, "cap01.wav");
  if (!reader) {
    v3d::test::must(reader.error().message.find('\n') == std::string::npos);
    return 0;
  }
  const auto channels = static_cast<size_t>(reader->format().channels);
  v3d::test::must(channels > 0 && reader->samples() >= 0);
  const auto values = reader->read(reader->samples() / 2, 4096);
  if (values) v3d::test::must(values->size() % channels == 0 && values->size() <= 4096 * channels);
  return 0;
}
