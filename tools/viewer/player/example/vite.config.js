import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));

// The example bundles three.js and the built package.
export default defineConfig({
  root: here('.'),
  base: './',
  // The package has no node_modules beside it in the build folder, so the peer is named.
  resolve: {
    alias: [
      { find: '@v3d/player', replacement: `${process.env.V3D_PLAYER_OUT ?? here('../dist')}/v3d-player.js` },
      { find: /^three\/addons\//, replacement: here('../../node_modules/three/examples/jsm/') },
      { find: /^three$/, replacement: here('../../node_modules/three') },
    ],
  },
  build: {
    outDir: process.env.V3D_EXAMPLE_OUT ?? here('dist'),
    emptyOutDir: true,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1000,
  },
});
