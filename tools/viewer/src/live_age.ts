// Texts about the age of the live picture. Pure.

/** After this time without a mesh, the picture is not live. The same as LiveFeed::kMaxAge (daemon/viewd/web_streams.h). */
export const MAX_LIVE_AGE_MS = 5000;

/** `ageMs`: time since the last mesh was shown. `trouble` is empty while the picture is live. */
export function liveTexts(take: string, ageMs: number): { title: string; trouble: string } {
  if (ageMs <= MAX_LIVE_AGE_MS) return { title: `Live: ${take}`, trouble: '' };
  return {
    title: `Last live mesh: ${take}`,
    trouble: `No mesh of ${take} for more than 5 s: the take has ended, or its meshes are delayed. The last one is shown.`,
  };
}
