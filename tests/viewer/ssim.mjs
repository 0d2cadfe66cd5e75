/**
 * Structural similarity (SSIM) of the luma of two RGBA images of the same size, the mean over windows of 8 x 8 pixels that
 * overlap by half. Windows in which both images are uniform and nearly equal are left out. Returns 1 without any window.
 * Source: Wang et al. 2004.
 */
export function ssim(a, b, width, height) {
  const luma = (rgba) => Float64Array.from({ length: width * height }, (_, n) =>
    0.299 * rgba[4 * n] + 0.587 * rgba[4 * n + 1] + 0.114 * rgba[4 * n + 2]);
  const [p, q] = [luma(a), luma(b)];
  const [c1, c2] = [(0.01 * 255) ** 2, (0.03 * 255) ** 2];
  let sum = 0;
  let windows = 0;
  for (let y = 0; y + 8 <= height; y += 4) {
    for (let x = 0; x + 8 <= width; x += 4) {
      let [sp, sq, spp, sqq, spq] = [0, 0, 0, 0, 0];
      for (let n = 0; n < 64; ++n) {
        const at = (y + (n >> 3)) * width + x + (n & 7);
        sp += p[at]; sq += q[at];
        spp += p[at] ** 2; sqq += q[at] ** 2; spq += p[at] * q[at];
      }
      const [mp, mq] = [sp / 64, sq / 64];
      const [vp, vq, cov] = [spp / 64 - mp * mp, sqq / 64 - mq * mq, spq / 64 - mp * mq];
      if (vp < 1 && vq < 1 && Math.abs(mp - mq) < 2) continue;
      sum += ((2 * mp * mq + c1) * (2 * cov + c2)) / ((mp * mp + mq * mq + c1) * (vp + vq + c2));
      ++windows;
    }
  }
  return windows ? sum / windows : 1;
}
