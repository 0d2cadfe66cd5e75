// @v3d/player: the web component <v3d-player>, which this module defines, and the object VolumePlayer for three.js.
import { V3dPlayerElement } from './player_element';

export { V3dPlayerElement };
export { VolumePlayer, type VolumePlayerEventMap, type VolumePlayerOptions } from './volume_player';

if (!customElements.get('v3d-player')) customElements.define('v3d-player', V3dPlayerElement);
